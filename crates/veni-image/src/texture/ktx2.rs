//! KTX 2.0, cube maps without supercompression.
//!
//! Identifier, header, index of levels (the largest first), data format descriptor, key–value data, then the levels, the smallest
//! first, six faces each. All little-endian.

use veni_light::light::CubeMap;

use super::TexelFormat;
use crate::{Error, Result};

const IDENTIFIER: [u8; 12] = [0xAB, b'K', b'T', b'X', b' ', b'2', b'0', 0xBB, b'\r', b'\n', 0x1A, b'\n'];
/// Bytes before the index of levels.
const HEADER: usize = 80;

/// A chain of cubes, each half the size of the one before, as a KTX2 file.
///
/// # Errors
/// [`Error::Unsupported`] for [`TexelFormat::R11G11B10`], which nothing here needs; [`Error::Invalid`] for a value that the
/// format cannot hold.
///
/// # Panics
/// If there is no level, or the sizes do not halve.
pub fn ktx2(levels: &[CubeMap], format: TexelFormat) -> Result<Vec<u8>> {
    let size = levels[0].size();
    assert!(
        levels.iter().enumerate().all(|(k, level)| level.size() == size >> k),
        "levels that do not halve"
    );
    let (vk_format, type_size) = match format {
        TexelFormat::E5B9G9R9 => (123, 4),
        TexelFormat::Rgba16F => (97, 2),
        TexelFormat::R11G11B10 => {
            return Err(Error::unsupported("KTX2 files are written in E5B9G9R9 or halves"));
        }
    };
    let (descriptor, keys) = (descriptor(format), key_values());
    let data = levels.iter().map(|level| format.encode(level.texels())).collect::<Result<Vec<_>>>()?;

    let descriptor_at = HEADER + 24 * levels.len();
    let keys_at = descriptor_at + descriptor.len();
    let mut end = keys_at + keys.len();
    let mut offsets = vec![0; levels.len()];
    for (offset, data) in offsets.iter_mut().zip(&data).rev() {
        *offset = end.next_multiple_of(format.bytes());
        end = *offset + data.len();
    }

    let mut file = Vec::with_capacity(end);
    file.extend(IDENTIFIER);
    let side = size as u32;
    for word in [vk_format, type_size, side, side, 0, 0, 6, levels.len() as u32, 0] {
        file.extend(word.to_le_bytes());
    }
    for word in [descriptor_at, descriptor.len(), keys_at, keys.len()] {
        file.extend((word as u32).to_le_bytes());
    }
    file.extend([0; 16]); // no supercompression data
    for (offset, data) in offsets.iter().zip(&data) {
        for word in [*offset, data.len(), data.len()] {
            file.extend((word as u64).to_le_bytes());
        }
    }
    file.extend(descriptor);
    file.extend(keys);
    for (offset, data) in offsets.iter().zip(&data).rev() {
        file.resize(*offset, 0);
        file.extend(data);
    }
    Ok(file)
}

/// The basic data format descriptor, its total size first.
fn descriptor(format: TexelFormat) -> Vec<u8> {
    // bit offset, bits − 1, channel and qualifiers, lower, upper
    let samples: Vec<(u16, u8, u8, u32, u32)> = match format {
        // mantissas (1 is 256 with exponent 16, 8448), each followed by the exponent, whose bias is 15
        TexelFormat::E5B9G9R9 => {
            (0..3u8).flat_map(|c| [(u16::from(c) * 9, 8, c, 0, 8448), (27, 4, c | 0x20, 15, 31)]).collect()
        }
        // signed floats: −1 to 1
        _ => [0u8, 1, 2, 15]
            .iter()
            .zip([0, 16, 32, 48])
            .map(|(c, at)| (at, 15, c | 0xC0, (-1f32).to_bits(), 1f32.to_bits()))
            .collect(),
    };
    let block = 24 + 16 * samples.len();
    let mut out = Vec::with_capacity(4 + block);
    out.extend((4 + block as u32).to_le_bytes());
    out.extend([0; 4]); // Khronos, basic
    out.extend(2u16.to_le_bytes()); // version 1.3
    out.extend((block as u16).to_le_bytes());
    out.extend([1, 1, 1, 0]); // RGBSDA, BT.709 primaries, linear, straight alpha
    out.extend([0; 4]); // blocks of 1 × 1 × 1 × 1
    out.extend([format.bytes() as u8, 0, 0, 0, 0, 0, 0, 0]);
    for (offset, length, channel, lower, upper) in samples {
        out.extend(offset.to_le_bytes());
        out.extend([length, channel, 0, 0, 0, 0]);
        out.extend(lower.to_le_bytes());
        out.extend(upper.to_le_bytes());
    }
    out
}

/// Orientation and writer, in the order of their keys.
fn key_values() -> Vec<u8> {
    let mut out = Vec::new();
    for (key, value) in [("KTXorientation", "rd"), ("KTXwriter", concat!("veni ", env!("CARGO_PKG_VERSION")))]
    {
        out.extend((key.len() as u32 + value.len() as u32 + 2).to_le_bytes());
        for text in [key, value] {
            out.extend(text.as_bytes());
            out.push(0);
        }
        out.resize(out.len().next_multiple_of(4), 0);
    }
    out
}

/// What the first bytes of a KTX2 file say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ktx2Header {
    /// Vulkan's number of the format; 0 if it is none of Vulkan's.
    pub vk_format: u32,
    /// Texels across.
    pub width: u32,
    /// Texels down; 0 for a one-dimensional texture.
    pub height: u32,
    /// Layers of an array; 0 if it is none.
    pub layers: u32,
    /// 6 for a cube map, else 1.
    pub faces: u32,
    /// Levels in the file; 0 if the loader is to make them.
    pub levels: u32,
    /// 0 none, 1 Basis, 2 Zstandard, 3 zlib.
    pub supercompression: u32,
}

impl Ktx2Header {
    /// Bytes that [`Ktx2Header::read`] needs.
    pub const LEN: usize = HEADER;

    /// Whether a file that begins like this is KTX2.
    pub fn recognises(start: &[u8]) -> bool {
        start.starts_with(&IDENTIFIER)
    }

    /// The header at the beginning of a file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not a KTX2 file, cut short, or has no texels.
    pub fn read(start: &[u8]) -> Result<Self> {
        if !Self::recognises(start) {
            return Err(Error::invalid("is not a KTX2 file"));
        }
        let Some(words) = start.get(12..48) else {
            return Err(Error::invalid(format!("a KTX2 file of {} bytes has no whole header", start.len())));
        };
        let word = |k: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| words[4 * k + i]));
        let header = Self {
            vk_format: word(0),
            width: word(2),
            height: word(3),
            layers: word(5),
            faces: word(6),
            levels: word(7),
            supercompression: word(8),
        };
        if header.width == 0 || !matches!(header.faces, 1 | 6) {
            return Err(Error::invalid(format!(
                "a KTX2 texture of {} × {} texels and {} faces cannot be",
                header.width, header.height, header.faces
            )));
        }
        Ok(header)
    }
}
