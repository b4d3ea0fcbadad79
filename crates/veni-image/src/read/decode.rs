//! From the bytes of a PNG, JPEG, WebP or AVIF file to values and what they mean.

use std::io::{Cursor, Read};
use std::path::Path;

use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, Limits};

use super::display::{self, Tags};
use super::gain_map::{self, Found, GainMap};
use super::gpano::{Crop, Sphere};
use super::meaning::{Curve, Meaning};
use super::xmp::{self, Namespace};
use super::{
    LdrPanorama, ReadOptions, TransferFunction, exif, first_bytes, jpeg, open, png, precheck, unknown,
};
use crate::panorama::Panorama;
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// Values of the file as they lie in it (upright), and what else it says.
pub(super) struct Decoded {
    pub(super) panorama: LdrPanorama,
    pub(super) gain_map: Option<GainMap>,
    pub(super) crop: Option<(Crop, Equirect)>,
}

impl Decoded {
    /// The display values, in their full sphere.
    pub(super) fn display(self) -> LdrPanorama {
        let LdrPanorama { grid, values, known, meaning } = self.panorama;
        match self.crop {
            None => LdrPanorama { grid, values, known, meaning },
            Some((crop, full)) => {
                let (values, known) = place(crop, grid, &values, known);
                LdrPanorama { grid: full, values, known: Some(known), meaning }
            }
        }
    }

    /// Whether it holds high dynamic range.
    pub(super) fn is_high(&self) -> bool {
        self.gain_map.is_some() || self.panorama.meaning.curve.is_high()
    }

    /// Radiance, in its full sphere, of a file that [is high](Decoded::is_high).
    pub(super) fn radiance(self) -> Panorama {
        let mut panorama = self.panorama.linear_as_stored(TransferFunction::Srgb);
        if let Some(map) = &self.gain_map {
            map.apply(panorama.grid.width, panorama.pixels_mut());
            panorama
                .notes
                .push(format!("its gain map is applied: up to {:.1} stops above white", map.stops()));
        }
        self.panorama.to_rec709(&mut panorama);
        if let Some((crop, full)) = self.crop {
            let (pixels, known) = place(crop, panorama.grid, &panorama.pixels, panorama.known.take());
            panorama = Panorama { grid: full, pixels, known: Some(known), ..panorama };
        }
        panorama
    }
}

fn place(
    crop: Crop,
    grid: Equirect,
    values: &[[f32; 3]],
    known: Option<Vec<f32>>,
) -> (Vec<[f32; 3]>, Vec<f32>) {
    let size = [grid.width, grid.height];
    let known = known.unwrap_or_else(|| vec![1.0; grid.len()]);
    (crop.place(size, values, [0.0; 3]), crop.place(size, &known, 0.0))
}

pub(super) fn decode(path: &Path, options: &ReadOptions) -> Result<Decoded> {
    let mut file = open(path)?;
    let start = first_bytes(&mut file, path)?;
    let Some((format, name)) = super::format(&start) else {
        return Err(unknown(&start, "neither a PNG, a JPEG, a WebP nor an AVIF file"));
    };
    #[cfg(feature = "avif")]
    if format == ImageFormat::Avif {
        let panorama = super::avif::read(file, path, options)?;
        return Ok(Decoded { panorama, gain_map: None, crop: None });
    }
    let wrap = |error: ImageError| match error {
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            Error::invalid(format!("truncated {name} file"))
        }
        ImageError::IoError(e) if e.raw_os_error().is_some() => Error::io(path, "read", e),
        ImageError::Unsupported(e) => Error::unsupported(format!("{name}: {e}")),
        ImageError::Limits(_) => Error::too_large(format!(
            "its {name} decoder asks for more than the {} MiB that {} pixels are given",
            allocation(options) >> 20,
            options.max_pixels
        )),
        other => Error::invalid(format!("damaged or truncated {name} file: {other}")),
    };
    precheck::budget(precheck::ldr(&mut file, path, format)?, options)?;
    match format {
        ImageFormat::Jpeg => {
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).map_err(|e| Error::io(path, "read", e))?;
            if !jpeg::ends(&bytes) {
                return Err(Error::invalid("truncated JPEG file"));
            }
            let decoder = JpegDecoder::new(Cursor::new(&bytes)).map_err(wrap)?;
            let tags = jpeg::tags(&bytes);
            let decoded = pixels(decoder, tags, Some(&bytes), options, wrap)?;
            jpeg::complete(&bytes).map(|()| decoded)
        }
        ImageFormat::WebP => {
            let mut decoder = WebPDecoder::new(file).map_err(wrap)?;
            decoder.set_limits(limits(options)).map_err(wrap)?;
            let exif = decoder.exif_metadata().map_err(wrap)?;
            let packet = decoder.xmp_metadata().map_err(wrap)?;
            let packets = packet.iter().map(|packet| xmp::text(packet)).collect();
            let mut tags = Tags { exif, packets, ..Tags::default() };
            if decoder.has_animation() {
                tags.notes.push("is animated (WebP): its first frame is taken".to_owned());
            }
            pixels(decoder, tags, None, options, wrap)
        }
        _ => {
            let tags = png::tags(&mut file)?;
            let decoder = PngDecoder::with_limits(file, limits(options)).map_err(wrap)?;
            pixels(decoder, tags, None, options, wrap)
        }
    }
}

/// 8 bytes of the largest sample layout per pixel, and as much again for a decoder's own buffers.
fn allocation(options: &ReadOptions) -> u64 {
    options.max_pixels.saturating_mul(16) as u64
}

fn limits(options: &ReadOptions) -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(allocation(options));
    limits
}

/// What the decoder of any of these formats gives; `jpeg` is the whole file where it is one.
fn pixels(
    mut decoder: impl ImageDecoder,
    mut tags: Tags,
    jpeg: Option<&[u8]>,
    options: &ReadOptions,
    wrap: impl Fn(ImageError) -> Error,
) -> Result<Decoded> {
    decoder.set_limits(limits(options)).map_err(&wrap)?;
    let orientation = orientation(&tags);
    let (width, height) = decoder.dimensions();
    let stored = [width as usize, height as usize];
    let [width, height] = if on_its_side(orientation) { [stored[1], stored[0]] } else { stored };
    // data are what they are, wherever and in whichever colours they might be shown
    let (mut crop, mut gain_map, mut meaning) =
        (None, None, Meaning { curve: Curve::Srgb, ..Meaning::default() });
    let mut sphere = Sphere::default();
    if !options.data {
        sphere = Sphere::of(&tags.packets, [width, height])?;
    }
    let grid = if let Some(part) = sphere.crop.take().filter(|_| !options.data) {
        if options.place_parts {
            crop = Some((part, part.grid(options)?));
            sphere.notes.push(format!("is {}: the rest is unknown", part.describe()));
        } else {
            sphere.notes.push(format!("is {}, by its XMP (GPano), which is ignored", part.describe()));
        }
        ReadOptions { any_aspect: options.any_aspect || crop.is_some(), ..options.clone() }
            .check(width, height)?
    } else {
        options.check(width, height)?
    };
    if !options.data {
        tags.icc = decoder.icc_profile().map_err(&wrap)?;
        meaning = display::meaning(&tags)?;
        if let Some(bytes) = jpeg {
            match gain_map::find(bytes, &tags.packets, stored)? {
                Found::Map(map) => gain_map = Some(map.oriented(orientation)),
                Found::Note(note) => meaning.note(note),
                Found::None => {}
            }
        }
        meaning.notes.append(&mut sphere.notes);
    }
    let mut image = DynamicImage::from_decoder(decoder).map_err(wrap)?;
    image.apply_orientation(orientation);
    let (values, known) = values(grid, &image);
    Ok(Decoded { panorama: LdrPanorama { grid, values, known, meaning }, gain_map, crop })
}

/// By EXIF; where that says nothing, by XMP's copy of the same tag.
fn orientation(tags: &Tags) -> Orientation {
    let copy = || {
        let code = Namespace::first(&tags.packets, xmp::TIFF)?.number("Orientation")?;
        Orientation::from_exif(code as u8).filter(|_| code.fract() == 0.0)
    };
    tags.exif.as_deref().and_then(exif::orientation).or_else(copy).unwrap_or(Orientation::NoTransforms)
}

/// Whether turning the image upright exchanges its sides.
fn on_its_side(orientation: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)
}

/// Display values of any sample layout, and how much of each pixel is known by their alpha. The image is read sample by sample: a
/// copy in a common layout would take as much memory as the values.
fn values(grid: Equirect, image: &DynamicImage) -> (Vec<[f32; 3]>, Option<Vec<f32>>) {
    use DynamicImage as D;
    let byte = |v: u8| f32::from(v) / 255.0;
    let word = |v: u16| f32::from(v) / 65535.0;
    let mut values = Vec::with_capacity(grid.len());
    let mut known = None;
    match image {
        D::ImageLuma8(image) => values.extend(image.pixels().map(|p| [byte(p.0[0]); 3])),
        D::ImageLuma16(image) => values.extend(image.pixels().map(|p| [word(p.0[0]); 3])),
        D::ImageRgb8(image) => values.extend(image.pixels().map(|p| p.0.map(byte))),
        D::ImageRgb16(image) => values.extend(image.pixels().map(|p| p.0.map(word))),
        D::ImageLumaA8(image) => {
            values.extend(image.pixels().map(|p| [byte(p.0[0]); 3]));
            known = hidden(image.pixels().map(|p| p.0[1]), u8::MAX, byte);
        }
        D::ImageLumaA16(image) => {
            values.extend(image.pixels().map(|p| [word(p.0[0]); 3]));
            known = hidden(image.pixels().map(|p| p.0[1]), u16::MAX, word);
        }
        D::ImageRgba8(image) => {
            values.extend(image.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(byte)));
            known = hidden(image.pixels().map(|p| p.0[3]), u8::MAX, byte);
        }
        other => {
            let rgba = other.to_rgba16();
            values.extend(rgba.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(word)));
            known = hidden(rgba.pixels().map(|p| p.0[3]), u16::MAX, word);
        }
    }
    (values, known)
}

/// An alpha channel from 0 to 1, where it hides anything.
fn hidden<T: PartialOrd + Copy>(
    alpha: impl Iterator<Item = T> + Clone,
    opaque: T,
    unit: impl Fn(T) -> f32,
) -> Option<Vec<f32>> {
    alpha.clone().any(|a| a < opaque).then(|| alpha.map(unit).collect())
}
