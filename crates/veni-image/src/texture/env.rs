//! Babylon.js' `.env`: a magic number, JSON, a zero byte, then a PNG in RGBD for each level and face.

use serde::Deserialize;
use veni_light::light::CubeMap;
use veni_light::sphere::CubeFace;

use super::rgbd_png;
use crate::{Error, Result};

const MAGIC: [u8; 8] = [0x86, 0x16, 0x87, 0x96, 0xF6, 0xD6, 0x96, 0x36];
/// The longest JSON that is read.
const LONGEST: usize = 1 << 20;
/// The coefficients of the irradiance polynomial, in the order that [`env`] takes them.
const TERMS: [&str; 9] = ["x", "y", "z", "xx", "yy", "zz", "yz", "zx", "xy"];

/// A chain of cubes down to one texel, and the polynomial of diffuse light in the order x, y, z, xx, yy, zz, yz, zx, xy.
///
/// # Errors
/// [`Error::Invalid`] for a value beyond the 255 of RGBD.
///
/// # Panics
/// If there is no level, or the sizes do not halve.
pub fn env(levels: &[CubeMap], irradiance: &[[f32; 3]; 9]) -> Result<Vec<u8>> {
    let size = levels[0].size();
    assert!(
        levels.iter().enumerate().all(|(k, level)| level.size() == size >> k),
        "levels that do not halve"
    );
    let mut data = Vec::new();
    let mut mipmaps = Vec::new();
    for level in levels {
        for face in CubeFace::ALL {
            let png = rgbd_png(level.size(), level.face(face))?;
            mipmaps.push(format!("{{\"length\":{},\"position\":{}}}", png.len(), data.len()));
            data.extend(png);
        }
    }
    let terms: Vec<String> =
        (TERMS.iter().zip(irradiance)).map(|(name, [r, g, b])| format!("\"{name}\":[{r},{g},{b}]")).collect();
    let json = format!(
        "{{\"version\":1,\"width\":{size},\"irradiance\":{{{}}},\"specular\":{{\"mipmaps\":[{}],\"lodGenerationScale\":0.8}}}}",
        terms.join(","),
        mipmaps.join(",")
    );
    let mut file = MAGIC.to_vec();
    file.extend(json.as_bytes());
    file.push(0);
    file.extend(data);
    Ok(file)
}

/// What the JSON of an `.env` file says.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct EnvHeader {
    /// 1, or 2 where images may be other than PNG.
    pub version: u32,
    /// Texels along a side of the first level.
    pub width: u32,
    /// Where the images are.
    pub specular: EnvSpecular,
}

/// The images of an `.env` file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct EnvSpecular {
    /// Six for each level.
    pub mipmaps: Vec<EnvImage>,
    /// Levels per factor of two of roughness.
    #[serde(rename = "lodGenerationScale", default)]
    pub lod_generation_scale: Option<f64>,
}

/// One image, counted from the end of the JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub struct EnvImage {
    /// Bytes.
    pub length: u64,
    /// First byte.
    pub position: u64,
}

impl EnvHeader {
    /// Bytes in which the JSON ends at the latest.
    pub const LEN: usize = MAGIC.len() + LONGEST;

    /// Whether a file that begins like this is an `.env`.
    pub fn recognises(start: &[u8]) -> bool {
        start.starts_with(&MAGIC)
    }

    /// The header at the beginning of a file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not such a file, or its JSON is damaged or does not end.
    pub fn read(start: &[u8]) -> Result<Self> {
        let Some(rest) = start.strip_prefix(&MAGIC) else {
            return Err(Error::invalid("is not a Babylon.js environment"));
        };
        let Some(end) = rest.iter().take(LONGEST).position(|b| *b == 0) else {
            return Err(Error::invalid(format!(
                "the JSON of an environment does not end within {LONGEST} bytes"
            )));
        };
        serde_json::from_slice(&rest[..end])
            .map_err(|e| Error::invalid(format!("the JSON of an environment cannot be read ({e})")))
    }
}
