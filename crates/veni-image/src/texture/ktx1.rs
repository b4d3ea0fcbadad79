//! KTX 1.1, cube maps of R11F_G11F_B10F: what Filament loads.
//!
//! Identifier, header, key–value data, then the levels, the largest first: the size of one face, six faces. All little-endian.

use veni_light::light::CubeMap;

use super::TexelFormat;
use crate::Result;

const IDENTIFIER: [u8; 12] = [0xAB, b'K', b'T', b'X', b' ', b'1', b'1', 0xBB, b'\r', b'\n', 0x1A, b'\n'];
/// OpenGL's numbers: packed type, format, internal format.
const UNSIGNED_INT_10F_11F_11F_REV: u32 = 0x8C3B;
const RGB: u32 = 0x1907;
const R11F_G11F_B10F: u32 = 0x8C3A;

/// A chain of cubes, each half the size of the one before, with text under names, as a KTX1 file.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for a value that R11F_G11F_B10F cannot hold.
///
/// # Panics
/// If there is no level, or the sizes do not halve.
pub fn ktx1(levels: &[CubeMap], keys: &[(&str, &str)]) -> Result<Vec<u8>> {
    let size = levels[0].size();
    assert!(
        levels.iter().enumerate().all(|(k, level)| level.size() == size >> k),
        "levels that do not halve"
    );
    let mut pairs = Vec::new();
    for (key, value) in keys {
        pairs.extend((key.len() as u32 + value.len() as u32 + 2).to_le_bytes());
        for text in [key, value] {
            pairs.extend(text.as_bytes());
            pairs.push(0);
        }
        pairs.resize(pairs.len().next_multiple_of(4), 0);
    }
    let mut file = Vec::new();
    file.extend(IDENTIFIER);
    let (side, count) = (size as u32, levels.len() as u32);
    let header = [
        0x0403_0201,
        UNSIGNED_INT_10F_11F_11F_REV,
        4,
        RGB,
        R11F_G11F_B10F,
        RGB,
        side,
        side,
        0,
        0,
        6,
        count,
        pairs.len() as u32,
    ];
    for word in header {
        file.extend(u32::to_le_bytes(word));
    }
    file.extend(pairs);
    for level in levels {
        let data = TexelFormat::R11G11B10.encode(level.texels())?;
        file.extend((data.len() as u32 / 6).to_le_bytes());
        file.extend(data);
    }
    Ok(file)
}
