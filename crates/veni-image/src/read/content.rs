//! One way in for every format: what a file holds, radiance or display values.

use std::path::Path;

use super::decode::{Decoded, decode};
use super::{
    Kind, LdrPanorama, ReadOptions, declared, exr, first_bytes, format, hdr, kind, kind_or, open, precheck,
};
use crate::panorama::Panorama;
use crate::{Error, Result};

/// What a file of none of the formats is not.
const NONE: &str = if cfg!(feature = "avif") {
    "neither an OpenEXR, a Radiance .hdr, a PNG, a JPEG, a WebP nor an AVIF file"
} else {
    "neither an OpenEXR, a Radiance .hdr, a PNG, a JPEG nor a WebP file"
};

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
            let kind = kind_or(&mut file, path, NONE)?;
            if !matches!(kind, Kind::Display(_)) {
                precheck::budget(declared(&mut file, path)?, options)?;
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

impl LdrPanorama {
    /// Whether the content of `path` is a format that [`LdrPanorama::read`] reads: a look at its first bytes.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Invalid`] for a folder.
    pub fn recognise(path: impl AsRef<Path>) -> Result<bool> {
        let path = path.as_ref();
        let start = open(path).and_then(|mut file| first_bytes(&mut file, path));
        start.map(|s| format(&s).is_some()).map_err(|e| e.in_file(path))
    }

    /// Reads a PNG, JPEG, WebP or (feature `avif`) AVIF file; see [`LdrPanorama::read_with`].
    ///
    /// # Errors
    /// As [`LdrPanorama::read_with`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        Self::read_with(path, &ReadOptions::default())
    }

    /// Reads a PNG, JPEG or WebP file of 8 or 16 bits, or an AVIF file (feature `avif`) of 8 to 12, grey or coloured, turned
    /// upright where its EXIF data says so (AVIF that is to be turned is refused); the content decides the format, not the
    /// name. What the file says of its colours (cICP, ICC profile, gAMA and cHRM, EXIF; [`METADATA`](crate::METADATA)) is
    /// applied by [`LdrPanorama::linear`]. A part of a panorama (GPano) is placed in its full sphere, the rest unknown; what
    /// is transparent is unknown too. Gain maps, which make the file one of high dynamic range, are left to
    /// [`Content::read`](crate::Content::read).
    ///
    /// # Errors
    /// [`Error::Unsupported`] for other formats; [`Error::Invalid`] for damaged files and for sizes that `options`
    /// refuse, before pixels are allocated; [`Error::Io`] if the file cannot be read.
    pub fn read_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        decode(path, options).map(Decoded::display).map_err(|e| e.in_file(path))
    }
}

/// The radiance that a file holds.
pub(super) fn radiance(path: &Path, options: &ReadOptions) -> Result<Panorama> {
    let mut file = open(path)?;
    let kind = kind(&mut file, path)?;
    if !matches!(kind, Kind::Display(_)) {
        precheck::budget(declared(&mut file, path)?, options)?;
    }
    match kind {
        Kind::Exr => exr::read(file, path, options),
        Kind::Hdr => hdr::read(file, path, options),
        Kind::Display(format) => match decode(path, options)? {
            decoded if decoded.is_high() => Ok(decoded.radiance()),
            low => {
                let notes = low.panorama.notes().to_vec();
                Err(Error::LowRange { path: path.to_path_buf(), format, notes })
            }
        },
    }
}
