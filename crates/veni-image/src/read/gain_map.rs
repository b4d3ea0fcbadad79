//! Gain maps in JPEG (Adobe's specification 1.0, "Ultra HDR"): high dynamic range as a second picture that says by how much each
//! pixel of the first is brighter.
//!
//! With a display value's linear light L, the map's value g and W = 1 (a display that can show all of it):
//! L′ = (L + o_sdr) 2^(min + (max − min) g^(1/γ)) − o_hdr. White of the first picture stays 1.

use std::io::Cursor;
use std::path::Path;

use image::codecs::jpeg::JpegDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat};
use rayon::prelude::*;

use super::xmp::{APPLE_GAIN_MAP, GAIN_MAP, Namespace};
use super::{jpeg, precheck};
use crate::{Error, Result};

/// What is said of a gain map.
pub(super) enum Found {
    None,
    Map(Box<GainMap>),
    /// There is one, but it cannot be applied.
    Note(String),
}

/// A gain map and how it is meant.
#[derive(Debug)]
pub(super) struct GainMap {
    image: DynamicImage,
    /// Of red, green, blue: log2 of the least and the greatest gain, the map's exponent, the offsets.
    channels: [Gain; 3],
}

#[derive(Clone, Copy, Debug)]
struct Gain {
    least: f32,
    greatest: f32,
    gamma: f32,
    before: f32,
    after: f32,
}

/// Looks for the map behind a JPEG's first picture of `size` pixels, which has these `packets` of XMP.
///
/// # Errors
/// [`Error::Unsupported`] where the first picture is the one of high dynamic range; [`Error::Invalid`] for a damaged map.
pub(super) fn find(bytes: &[u8], packets: &[String], size: [usize; 2]) -> Result<Found> {
    let announced = Namespace::first(packets, GAIN_MAP).is_some();
    let multiple =
        jpeg::segments(bytes).any(|(marker, content)| marker == 0xE2 && content.starts_with(b"MPF\0"));
    if !announced && !multiple && !jpeg::has_iso_gain_map(bytes) {
        return Ok(Found::None);
    }
    let mut note = announced
        .then_some("says that it has a gain map (hdrgm), but no picture in it says how it is applied");
    for other in jpeg::others(bytes) {
        let (packets, _) = jpeg::packets(other);
        let mut gains = packets.iter().filter_map(|packet| Namespace::find(packet, GAIN_MAP));
        if let Some(gain) = gains.find(|gain| gain.number("GainMapMax").is_some()) {
            return GainMap::read(&gain, other, size).map(|map| Found::Map(Box::new(map)));
        }
        if Namespace::first(&packets, APPLE_GAIN_MAP).is_some() {
            note = Some("has a gain map of Apple's kind, which is not applied");
        }
        if note.is_none() && jpeg::has_iso_gain_map(other) {
            note = Some("has a gain map by ISO 21496-1 without hdrgm values, which is not applied");
        }
    }
    let sentence = |what| format!("{what}: the picture is taken as a display of limited range shows it");
    Ok(note.map_or(Found::None, |what| Found::Note(sentence(what))))
}

impl GainMap {
    fn read(gain: &Namespace<'_>, bytes: &[u8], size: [usize; 2]) -> Result<Self> {
        if gain.text("BaseRenditionIsHDR").is_some_and(|text| text.eq_ignore_ascii_case("true")) {
            return Err(Error::unsupported(
                "its gain map (hdrgm:BaseRenditionIsHDR) leads from high to limited range; save it as EXR",
            ));
        }
        let values = |name: &str, otherwise: f64| -> Result<[f32; 3]> {
            let wrong = || Error::invalid(format!("its gain map has no number or three in hdrgm:{name}"));
            if gain.text(name).is_none() {
                return Ok([otherwise as f32; 3]);
            }
            match gain.numbers(name).ok_or_else(wrong)?[..] {
                [one] => Ok([one as f32; 3]),
                [r, g, b] => Ok([r, g, b].map(|v| v as f32)),
                _ => Err(wrong()),
            }
        };
        let (least, greatest) = (values("GainMapMin", 0.0)?, values("GainMapMax", 1.0)?);
        let gamma = values("Gamma", 1.0)?;
        let (before, after) = (values("OffsetSDR", 1.0 / 64.0)?, values("OffsetHDR", 1.0 / 64.0)?);
        let plausible =
            |c: usize| gamma[c] > 0.0 && greatest[c] >= least[c] && greatest[c] <= 32.0 && least[c] >= -32.0;
        if !(0..3).all(plausible) {
            return Err(Error::invalid(format!(
                "its gain map has implausible values: hdrgm:GainMapMin {least:?}, GainMapMax {greatest:?}, Gamma {gamma:?}"
            )));
        }
        let damaged = |e: image::ImageError| Error::invalid(format!("its gain map is damaged: {e}"));
        let incomplete = |e: Error| Error::invalid(format!("its gain map: {e}"));
        // no limit was looked at behind the first picture
        precheck::ldr(&mut Cursor::new(bytes), Path::new(""), ImageFormat::Jpeg).map_err(incomplete)?;
        let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
        let (width, height) = decoder.dimensions();
        if width == 0 || height == 0 || width as usize > size[0] || height as usize > size[1] {
            return Err(Error::invalid(format!(
                "its gain map has {width} × {height} pixels, the picture {} × {}",
                size[0], size[1]
            )));
        }
        if !jpeg::ends(bytes) {
            return Err(Error::invalid("its gain map is truncated"));
        }
        jpeg::complete(bytes).map_err(incomplete)?;
        let image = DynamicImage::from_decoder(decoder).map_err(damaged)?;
        let channels = [0, 1, 2].map(|c| Gain {
            least: least[c],
            greatest: greatest[c],
            gamma: gamma[c],
            before: before[c],
            after: after[c],
        });
        Ok(Self { image, channels })
    }

    /// Turned like the picture it belongs to.
    pub(super) fn oriented(mut self, orientation: Orientation) -> Self {
        self.image.apply_orientation(orientation);
        self
    }

    /// The highest factor, for messages.
    pub(super) fn stops(&self) -> f32 {
        self.channels.iter().fold(0.0, |most, gain| most.max(gain.greatest))
    }

    /// Linear display light, `width` pixels a row, becomes radiance.
    pub(super) fn apply(&self, width: usize, pixels: &mut [[f32; 3]]) {
        let map = self.image.to_rgb8();
        let height = pixels.len() / width;
        let columns = taps(map.width() as usize, width);
        let rows = taps(map.height() as usize, height);
        let at = |x: usize, y: usize, c: usize| {
            f32::from(map.as_raw()[3 * (y * map.width() as usize + x) + c]) / 255.0
        };
        pixels.par_chunks_exact_mut(width).zip(&rows).for_each(|(line, &(top, bottom, t))| {
            for (pixel, &(left, right, s)) in line.iter_mut().zip(&columns) {
                for (c, value) in pixel.iter_mut().enumerate() {
                    let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
                    let upper = mix(at(left, top, c), at(right, top, c), s);
                    let lower = mix(at(left, bottom, c), at(right, bottom, c), s);
                    let Gain { least, greatest, gamma, before, after } = self.channels[c];
                    let gain = least + (greatest - least) * mix(upper, lower, t).powf(1.0 / gamma);
                    *value = ((*value + before) * gain.exp2() - after).max(0.0);
                }
            }
        });
    }
}

/// Between which two of `source` samples each of `target` pixels lies, and how far along.
fn taps(source: usize, target: usize) -> Vec<(usize, usize, f32)> {
    let step = source as f64 / target as f64;
    let last = source - 1;
    let tap = |k: usize| {
        let at = ((k as f64 + 0.5) * step - 0.5).clamp(0.0, last as f64);
        (at as usize, (at as usize + 1).min(last), at.fract() as f32)
    };
    (0..target).map(tap).collect()
}
