//! Reading: which format a file is, and the limits that its header must meet before pixels are allocated.

#[cfg(feature = "avif")]
mod avif;
mod content;
mod decode;
mod display;
mod exif;
mod exr;
mod gain_map;
mod gpano;
mod hdr;
mod icc;
mod jpeg;
mod ldr;
#[cfg(test)]
mod ldr_tests;
mod meaning;
mod metadata;
mod png;
mod precheck;
mod spaces;
mod xmp;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use image::ImageFormat;

use crate::limits::{EXAMINE_BYTES_PER_PIXEL, READ_BYTES_PER_PIXEL};
use crate::panorama::Panorama;
use crate::{Error, Result};
use veni_light::sphere::Equirect;

pub use content::Content;
pub use ldr::{LdrPanorama, TransferFunction};
pub use metadata::{METADATA, Metadata, Treatment};

pub use crate::limits::DEFAULT_MAX_PIXELS;

/// What [`Panorama::read_with`] accepts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// Largest number of pixels; a header that claims more is refused before anything is allocated.
    pub max_pixels: usize,
    /// Accept a width that is not twice the height.
    pub any_aspect: bool,
    /// Which EXR layer to read, for files with several ("ViewLayer.Combined" for channels "ViewLayer.Combined.R" …).
    pub layer: Option<String>,
    /// The values are not colours (normals, masks): they are given as stored, whatever the file says of colours.
    pub data: bool,
    /// A picture that its file calls a part of a panorama (GPano) is placed in its full sphere, the rest unknown; otherwise it
    /// is given as it is.
    pub place_parts: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            max_pixels: DEFAULT_MAX_PIXELS,
            any_aspect: false,
            layer: None,
            data: false,
            place_parts: true,
        }
    }
}

impl ReadOptions {
    /// Checks a size from a header.
    fn check(&self, width: usize, height: usize) -> Result<Equirect> {
        if width == 0 || height == 0 {
            return Err(Error::invalid(format!("the header says {width} × {height}: there are no pixels")));
        }
        if width.checked_mul(height).is_none_or(|n| n > self.max_pixels) {
            let limit = self.max_pixels;
            return Err(Error::beyond(
                format!("the header claims {width} × {height} pixels, more than the limit of {limit}"),
                (width as u64).saturating_mul(height as u64),
                limit as u64,
            ));
        }
        if width != 2 * height && !self.any_aspect {
            return Err(Error::invalid(format!(
                "{width} × {height} is not an equirectangular panorama: its width must be twice its height"
            )));
        }
        Ok(Equirect::new(width, height))
    }
}

impl Panorama {
    /// Reads an OpenEXR or Radiance `.hdr` panorama of at most [`DEFAULT_MAX_PIXELS`]; the content decides the
    /// format, not the name. See [`Panorama::read_with`].
    ///
    /// # Errors
    /// As [`Panorama::read_with`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        Self::read_with(path, &ReadOptions::default())
    }

    /// Reads an OpenEXR or Radiance `.hdr` panorama, or another file of high dynamic range (PNG or AVIF coded by PQ or HLG, a
    /// JPEG with a gain map). Values are as stored (possibly not finite: [`Panorama::sanitise`]) but for what the file says of
    /// them ([`METADATA`]); they are linear with Rec. 709 primaries.
    ///
    /// - OpenEXR: every compression and sample type of the `exr` crate, scan lines or tiles, the largest level
    ///   of multi-resolution files. The panorama is the display window; where the data window leaves some of it
    ///   uncovered it is [unknown](Panorama::known), and what lies outside is cut off. Colour channels
    ///   are R, G, B or, failing that, Y alone as grey, divided by alpha; what is transparent is unknown. A factor that
    ///   [`HalfRange::Fit`] recorded in the file is divided out again.
    /// - Radiance: values are divided by the product of the EXPOSURE lines, as that format asks. All eight orientations.
    ///
    /// [`HalfRange::Fit`]: super::HalfRange::Fit
    ///
    /// # Errors
    /// [`Error::LowRange`] for files of limited range (PNG, JPEG, …); [`Error::Unsupported`] for cube maps, deep or subsampled
    /// images and for colours that are not read; [`Error::Layers`] if several layers could be meant; [`Error::Invalid`] for damaged files and for sizes that `options` refuse;
    /// [`Error::Io`] if the file cannot be read.
    pub fn read_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        content::radiance(path, options).map_err(|e| e.in_file(path))
    }
}

/// The text attributes of an EXR file, from its header alone (no pixel is read); those of the first part where
/// parts disagree. A Radiance file gives its `NAME=value` header lines, PNG, JPEG, WebP and AVIF give nothing.
///
/// # Errors
/// As [`Panorama::read_with`] where the header is concerned.
pub fn attributes(path: impl AsRef<Path>) -> Result<BTreeMap<String, String>> {
    let path = path.as_ref();
    let read = || {
        let mut file = open(path)?;
        match kind(&mut file, path)? {
            Kind::Exr => exr::attributes(file, path),
            Kind::Hdr => hdr::attributes(file, path),
            Kind::Display(_) => Ok(BTreeMap::new()),
        }
    };
    read().map_err(|e| e.in_file(path))
}

/// Bytes of memory that reading, expanding and examining a file takes at its peak, by the size that its header declares; no
/// pixel is read. Nothing where it declares none, or more pixels than `options` allow: to read it is an error.
///
/// # Errors
/// As [`Panorama::read_with`] and [`LdrPanorama::read_with`] where the header is concerned.
pub fn peak_bytes(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Option<u64>> {
    let path = path.as_ref();
    let look = || {
        let mut file = open(path)?;
        let start = first_bytes(&mut file, path)?;
        // radiance is not expanded
        let each = if format(&start).is_some() { EXAMINE_BYTES_PER_PIXEL } else { READ_BYTES_PER_PIXEL };
        Ok(precheck::peak(declared(&mut file, path)?, each, options))
    };
    look().map_err(|e: Error| e.in_file(path))
}

/// The size that the header of a file of any format declares; rewinds.
fn declared(file: &mut (impl BufRead + Seek), path: &Path) -> Result<precheck::Size> {
    let start = first_bytes(file, path)?;
    let Some((format, _)) = format(&start) else {
        return match kind(file, path)? {
            Kind::Exr => precheck::exr(file, path),
            Kind::Hdr => precheck::hdr(file, path),
            Kind::Display(_) => Ok(None),
        };
    };
    #[cfg(feature = "avif")]
    if format == ImageFormat::Avif {
        let size = avif::declared(&mut *file, path)?;
        file.rewind().map_err(|e| Error::io(path, "read", e))?;
        return Ok(Some(size));
    }
    precheck::ldr(file, path, format)
}

fn open(path: &Path) -> Result<BufReader<File>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    if file.metadata().map_err(|e| Error::io(path, "read", e))?.is_dir() {
        return Err(Error::invalid("is a folder, not an image"));
    }
    Ok(BufReader::with_capacity(1 << 16, file))
}

enum Kind {
    Exr,
    Hdr,
    /// Of limited range as a rule.
    Display(&'static str),
}

/// Formats of limited range that [`LdrPanorama::read`] reads: where the name of each stands.
const LDR: &[(usize, &[u8], ImageFormat, &str)] = &[
    (0, b"\x89PNG", ImageFormat::Png, "PNG"),
    (0, b"\xFF\xD8\xFF", ImageFormat::Jpeg, "JPEG"),
    (0, b"RIFF", ImageFormat::WebP, "WebP"),
    #[cfg(feature = "avif")]
    (4, b"ftypavif", ImageFormat::Avif, "AVIF"),
];

/// The format that these first bytes begin, with its name.
fn format(start: &[u8]) -> Option<(ImageFormat, &'static str)> {
    let (.., format, name) = LDR.iter().find(|(at, magic, ..)| stands(start, *at, magic))?;
    // RIFF holds sound and video too
    let is_image = *format != ImageFormat::WebP || start.get(8..12) == Some(b"WEBP");
    is_image.then_some((*format, *name))
}

/// Formats that are not read: where the name of each stands.
const FOREIGN: &[(usize, &[u8], &str)] = &[
    // with the feature `avif` found before
    (4, b"ftypavif", "(built without the feature avif) AVIF"),
    (4, b"ftypavis", "Animated AVIF"),
    (4, b"ftypheic", "HEIF"),
    (0, b"BM", "BMP"),
    (0, b"GIF8", "GIF"),
    (0, b"II*\0", "TIFF"),
    (0, b"MM\0*", "TIFF"),
    (0, b"II+\0", "TIFF"),
    (0, b"MM\0+", "TIFF"),
    (4, b"ftypheix", "HEIF"),
    (4, b"ftypmif1", "HEIF"),
    (0, b"\xFF\x0A", "JPEG XL"),
    (4, b"JXL \r\n\x87\n", "JPEG XL"),
    (4, b"jP  \r\n\x87\n", "JPEG 2000"),
    (0, b"\xFF\x4F\xFF\x51", "JPEG 2000"),
    (0, b"PF\n", "PFM"),
    (0, b"Pf\n", "PFM"),
    (0, b"P5", "PGM"),
    (0, b"P6", "PPM"),
    (0, b"SDPX", "DPX"),
    (0, b"XPDS", "DPX"),
    (0, b"qoif", "QOI"),
    (0, b"8BPS", "Photoshop"),
    (0, b"DDS ", "DDS"),
];

/// What is saved in place of an image now and then: its beginning, what it is and what to do.
const IN_PLACE: &[(&[u8], &str)] = &[
    (b"version https://", "a pointer of Git LFS, not the image; 'git lfs pull' fetches it"),
    (b"<!DOCTYPE", "a web page, not an image; download the file itself"),
    (b"<!doctype", "a web page, not an image; download the file itself"),
    (b"<html", "a web page, not an image; download the file itself"),
];

/// The first bytes of a file, which tell its format; rewinds.
fn first_bytes(file: &mut (impl Read + Seek), path: &Path) -> Result<Vec<u8>> {
    let mut start = Vec::new();
    file.take(16).read_to_end(&mut start).map_err(|e| Error::io(path, "read", e))?;
    file.rewind().map_err(|e| Error::io(path, "read", e))?;
    Ok(start)
}

/// Recognises a format and rewinds; where radiance is wanted.
fn kind(file: &mut (impl Read + Seek), path: &Path) -> Result<Kind> {
    kind_or(file, path, "neither an OpenEXR nor a Radiance .hdr file")
}

/// Recognises a format and rewinds; `otherwise` says what the content is not.
fn kind_or(file: &mut (impl Read + Seek), path: &Path, otherwise: &str) -> Result<Kind> {
    let start = first_bytes(file, path)?;
    if start.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        precheck::exr(file, path)?;
        return Ok(Kind::Exr);
    }
    if start.starts_with(b"#?") {
        precheck::hdr(file, path)?;
        return Ok(Kind::Hdr);
    }
    if let Some((_, format)) = format(&start) {
        return Ok(Kind::Display(format));
    }
    Err(unknown(&start, otherwise))
}

/// Whether a name stands at a place.
fn stands(start: &[u8], at: usize, name: &[u8]) -> bool {
    start.get(at..).is_some_and(|start| start.starts_with(name))
}

/// The error for content that is none of the formats looked for.
fn unknown(start: &[u8], otherwise: &str) -> Error {
    if start.is_empty() {
        return Error::invalid("the file is empty");
    }
    if let Some((_, what)) = IN_PLACE.iter().find(|(begin, _)| start.starts_with(begin)) {
        return Error::unsupported(*what);
    }
    match FOREIGN.iter().find(|(at, magic, _)| stands(start, *at, magic)) {
        Some((.., name)) => Error::unsupported(format!(
            "{name} images are not read; convert it to EXR, or to PNG if it holds no high dynamic range"
        )),
        None => Error::unsupported(otherwise),
    }
}
