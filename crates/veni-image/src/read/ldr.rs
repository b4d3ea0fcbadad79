//! Panoramas of limited range: PNG, JPEG, WebP and AVIF, as the display values that are stored.

use std::io::{Read, Seek};
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::{LDR, ReadOptions, first_bytes, open, precheck, stands, unknown};
use crate::panorama::Panorama;
use crate::tonemap::srgb_to_linear;
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// A panorama of limited dynamic range: display values in [0, 1], as an 8- or 16-bit file has them, row-major.
/// They become radiance by [`LdrPanorama::linear`], or with what is clipped rebuilt by
/// veni-data.
#[derive(Clone, Debug, PartialEq)]
pub struct LdrPanorama {
    grid: Equirect,
    values: Vec<[f32; 3]>,
    /// Of every pixel, 0 to 1, where the file hides any.
    pub(super) alpha: Option<Vec<f32>>,
}

/// How display values become linear ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Transfer {
    /// The sRGB curve (IEC 61966-2-1). The default.
    #[default]
    Srgb,
    /// A power: v^γ.
    Gamma(f32),
}

impl Transfer {
    /// One display value in [0, 1] to a linear one in [0, 1].
    pub fn linear(self, value: f32) -> f32 {
        match self {
            Self::Srgb => srgb_to_linear(value),
            Self::Gamma(gamma) => value.powf(gamma),
        }
    }
}

impl LdrPanorama {
    /// A panorama from row-major display values, clamped to [0, 1].
    ///
    /// # Panics
    /// If there are not exactly W·H pixels.
    pub fn new(grid: Equirect, values: Vec<[f32; 3]>) -> Self {
        let Equirect { width, height } = grid;
        assert_eq!(values.len(), grid.len(), "a {width} × {height} panorama got {} pixels", values.len());
        let values = values.into_iter().map(|p| p.map(|v| v.clamp(0.0, 1.0))).collect();
        Self { grid, values, alpha: None }
    }

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
    /// name. Alpha hides nothing (see [`LdrPanorama::transparent`]);
    /// colour profiles are not applied: values are taken for Rec. 709 primaries.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for other formats; [`Error::Invalid`] for damaged files and for sizes that `options`
    /// refuse, before pixels are allocated; [`Error::Io`] if the file cannot be read.
    pub fn read_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        decode(path, options).map_err(|e| e.in_file(path))
    }

    /// The pixel grid.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// Display values in [0, 1], row-major.
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// Share of the pixels (0 to 1) that the file's alpha channel hides by more than half; 0 without one.
    pub fn transparent(&self) -> f64 {
        let hidden = self.alpha.as_ref().map_or(0, |alpha| alpha.iter().filter(|a| **a < 0.5).count());
        hidden as f64 / self.grid.len() as f64
    }

    /// The alpha channel, 0 to 1 for every pixel; `None` where there is none, or it hides nothing.
    pub fn alpha(&self) -> Option<&[f32]> {
        self.alpha.as_deref()
    }

    /// Plain linearisation: white is radiance 1, and so is everything that was brighter.
    pub fn linear(&self, transfer: Transfer) -> Panorama {
        Panorama::new(self.grid, self.values.iter().map(|p| p.map(|v| transfer.linear(v))).collect())
    }
}

/// The format that these first bytes begin, with its name.
pub(super) fn format(start: &[u8]) -> Option<(ImageFormat, &'static str)> {
    let (.., format, name) = LDR.iter().find(|(at, magic, ..)| stands(start, *at, magic))?;
    // RIFF holds sound and video too
    let is_image = *format != ImageFormat::WebP || start.get(8..12) == Some(b"WEBP");
    is_image.then_some((*format, *name))
}

fn decode(path: &Path, options: &ReadOptions) -> Result<LdrPanorama> {
    let mut file = open(path)?;
    let start = first_bytes(&mut file, path)?;
    let Some((format, name)) = format(&start) else {
        return Err(unknown(&start, "neither a PNG, a JPEG, a WebP nor an AVIF file"));
    };
    #[cfg(feature = "avif")]
    if format == ImageFormat::Avif {
        return super::avif::read(file, path, options);
    }
    let wrap = |error: ImageError| match error {
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            Error::invalid(format!("truncated {name} file"))
        }
        ImageError::IoError(e) if e.raw_os_error().is_some() => Error::io(path, "read", e),
        ImageError::Unsupported(e) => Error::unsupported(format!("{name}: {e}")),
        other => Error::invalid(format!("damaged or truncated {name} file: {other}")),
    };
    precheck::room(precheck::ldr(&mut file, path, format)?, options)?;
    if format == ImageFormat::Jpeg && !jpeg_ends(&mut file).map_err(|e| Error::io(path, "read", e))? {
        return Err(Error::invalid("truncated JPEG file"));
    }
    let mut reader = ImageReader::with_format(file, format);
    let mut limits = Limits::default();
    // 8 bytes of the largest sample layout per pixel, and as much again for a decoder's own buffers
    limits.max_alloc = Some(options.max_pixels.saturating_mul(16) as u64);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(wrap)?;
    let orientation = decoder.orientation().map_err(wrap)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = if on_its_side(orientation) { (height, width) } else { (width, height) };
    let grid = options.check(width as usize, height as usize)?;
    let mut image = DynamicImage::from_decoder(decoder).map_err(wrap)?;
    image.apply_orientation(orientation);
    Ok(values(grid, &image))
}

/// Whether a JPEG stream has an end marker behind the start of its first scan; the decoder paints what is missing grey.
/// Rewinds.
fn jpeg_ends(file: &mut (impl Read + Seek)) -> std::io::Result<bool> {
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    file.rewind()?;
    // segments before the scan are stepped over: thumbnails in them have an end of their own
    let mut at = 2;
    while let Some(&[0xFF, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == 0xDA {
            return Ok(bytes[at..].windows(2).any(|pair| pair == [0xFF, 0xD9]));
        }
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
    }
    // fill bytes or no scan at all: for the decoder to judge
    Ok(true)
}

/// Whether turning the image upright exchanges its sides.
fn on_its_side(orientation: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)
}

/// Display values of any sample layout, and their alpha. The image is read sample by sample: a copy in a common layout would
/// take as much memory as the values.
fn values(grid: Equirect, image: &DynamicImage) -> LdrPanorama {
    use DynamicImage as D;
    let byte = |v: u8| f32::from(v) / 255.0;
    let word = |v: u16| f32::from(v) / 65535.0;
    let mut values = Vec::with_capacity(grid.len());
    let mut alpha = None;
    match image {
        D::ImageLuma8(image) => values.extend(image.pixels().map(|p| [byte(p.0[0]); 3])),
        D::ImageLuma16(image) => values.extend(image.pixels().map(|p| [word(p.0[0]); 3])),
        D::ImageRgb8(image) => values.extend(image.pixels().map(|p| p.0.map(byte))),
        D::ImageRgb16(image) => values.extend(image.pixels().map(|p| p.0.map(word))),
        D::ImageLumaA8(image) => {
            values.extend(image.pixels().map(|p| [byte(p.0[0]); 3]));
            alpha = hidden(image.pixels().map(|p| p.0[1]), u8::MAX, byte);
        }
        D::ImageLumaA16(image) => {
            values.extend(image.pixels().map(|p| [word(p.0[0]); 3]));
            alpha = hidden(image.pixels().map(|p| p.0[1]), u16::MAX, word);
        }
        D::ImageRgba8(image) => {
            values.extend(image.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(byte)));
            alpha = hidden(image.pixels().map(|p| p.0[3]), u8::MAX, byte);
        }
        other => {
            let rgba = other.to_rgba16();
            values.extend(rgba.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(word)));
            alpha = hidden(rgba.pixels().map(|p| p.0[3]), u16::MAX, word);
        }
    }
    LdrPanorama { grid, values, alpha }
}

/// An alpha channel from 0 to 1, where it hides anything.
fn hidden<T: PartialOrd + Copy>(
    alpha: impl Iterator<Item = T> + Clone,
    opaque: T,
    unit: impl Fn(T) -> f32,
) -> Option<Vec<f32>> {
    alpha.clone().any(|a| a < opaque).then(|| alpha.map(unit).collect())
}
