//! One way in for every format: what a file holds, radiance or display values.

use std::path::Path;

use super::decode::{Decoded, decode};
use super::{Kind, LdrPanorama, ReadOptions, declared, exr, hdr, kind, open, precheck};
use crate::panorama::Panorama;
use crate::{Error, Result};

/// What a picture file holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Radiance: OpenEXR, Radiance, and what of the other formats is of high dynamic range (PQ, HLG, gain maps).
    Radiance(Panorama),
    /// Values between black and white of a display.
    Display(LdrPanorama),
}

impl Content {
    /// Reads a file of any format that this crate reads; its content decides, not its name.
    ///
    /// # Errors
    /// As [`Panorama::read_with`] and [`LdrPanorama::read_with`].
    pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        let read = || {
            let mut file = open(path)?;
            let kind = kind(&mut file, path)?;
            if !matches!(kind, Kind::Display(_)) {
                precheck::room(declared(&mut file, path)?, options)?;
            }
            Ok(match kind {
                Kind::Exr => Self::Radiance(exr::read(file, path, options)?),
                Kind::Hdr => Self::Radiance(hdr::read(file, path, options)?),
                Kind::Display(_) => Self::from(decode(path, options)?),
            })
        };
        read().map_err(|e: Error| e.in_file(path))
    }

    /// What the file says that is not applied, or is worth knowing.
    pub fn notes(&self) -> &[String] {
        match self {
            Self::Radiance(panorama) => panorama.notes(),
            Self::Display(panorama) => panorama.notes(),
        }
    }
}

impl From<Decoded> for Content {
    fn from(decoded: Decoded) -> Self {
        if decoded.is_high() { Self::Radiance(decoded.radiance()) } else { Self::Display(decoded.display()) }
    }
}

/// The radiance that a file holds.
pub(super) fn radiance(path: &Path, options: &ReadOptions) -> Result<Panorama> {
    let mut file = open(path)?;
    let kind = kind(&mut file, path)?;
    if !matches!(kind, Kind::Display(_)) {
        precheck::room(declared(&mut file, path)?, options)?;
    }
    match kind {
        Kind::Exr => exr::read(file, path, options),
        Kind::Hdr => hdr::read(file, path, options),
        // most hold none: what is wrong with those is not asked here
        Kind::Display(format) => match decode(path, options) {
            Ok(decoded) if decoded.is_high() => Ok(decoded.radiance()),
            _ => Err(Error::LowRange { path: path.to_path_buf(), format }),
        },
    }
}
