//! One AV1 frame, and its colours.

use rayon::prelude::*;
use re_rav1d::dav1d::{Decoder, Picture, PixelLayout, PlanarImageComponent, Settings};

use super::Coding;
use crate::{Error, Result};

/// A decoded frame.
pub(super) struct Frame {
    picture: Picture,
    /// Of a sample.
    bits: usize,
}

/// A plane's samples as they are stored.
struct Samples<'a> {
    bytes: &'a [u8],
    stride: usize,
    wide: bool,
    /// Its own width and height.
    size: [usize; 2],
    /// Pixels of the frame per sample, horizontally and vertically.
    step: [usize; 2],
}

impl Frame {
    /// # Errors
    /// [`Error::Invalid`] if the stream is damaged or has more than `limit` pixels.
    pub(super) fn decode(stream: &[u8], limit: u32) -> Result<Self> {
        let damaged = |e: re_rav1d::dav1d::Error| {
            Error::invalid(format!("damaged or truncated AVIF file: its AV1 stream: {e}"))
        };
        let mut settings = Settings::new();
        settings.set_n_threads(1);
        settings.set_frame_size_limit(limit);
        let mut decoder = Decoder::with_settings(&settings).map_err(damaged)?;
        decoder.send_data(stream.to_vec(), None, None, None).map_err(damaged)?;
        let picture = decoder.get_picture().map_err(damaged)?;
        let bits = picture.bits_per_component().map_or(8, |bits| bits.0);
        Ok(Self { picture, bits })
    }

    pub(super) fn size(&self) -> [usize; 2] {
        [self.picture.width() as usize, self.picture.height() as usize]
    }

    /// Samples from 0 to 1, row-major: those of an alpha channel.
    pub(super) fn opacity(&self, full_range: bool) -> Vec<f32> {
        let plane = self.picture.plane(PlanarImageComponent::Y);
        let luma = self.samples(&plane, [1, 1]);
        let scale = Scale::new(self.bits, full_range);
        let [width, height] = self.size();
        let row = |y: usize| (0..width).map(move |x| (x, y));
        (0..height).flat_map(row).map(|(x, y)| scale.luma(luma.at(x, y)).clamp(0.0, 1.0)).collect()
    }

    /// Display values, row-major.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a matrix that is none of the common ones.
    pub(super) fn rgb(&self, coding: Coding) -> Result<Vec<[f32; 3]>> {
        let layout = self.picture.pixel_layout();
        let step = match layout {
            PixelLayout::I400 | PixelLayout::I444 => [1, 1],
            PixelLayout::I422 => [2, 1],
            PixelLayout::I420 => [2, 2],
        };
        let scale = Scale::new(self.bits, coding.full_range);
        // the shares of red and blue in luma
        let shares = match coding.matrix {
            0 if layout != PixelLayout::I444 => {
                return Err(Error::invalid("damaged AVIF file: green, blue and red of different sizes"));
            }
            0 => None,
            1 => Some([0.2126, 0.0722]),
            2 | 5 | 6 => Some([0.299, 0.114]),
            4 => Some([0.30, 0.11]),
            9 => Some([0.2627, 0.0593]),
            other => {
                return Err(Error::unsupported(format!(
                    "AVIF with matrix coefficients {other} of H.273 is not read; convert it to PNG"
                )));
            }
        };
        let luma = self.picture.plane(PlanarImageComponent::Y);
        let luma = self.samples(&luma, [1, 1]);
        let chroma = match layout {
            PixelLayout::I400 => None,
            _ => Some([PlanarImageComponent::U, PlanarImageComponent::V].map(|c| self.picture.plane(c))),
        };
        let chroma = chroma.as_ref().map(|planes| planes.each_ref().map(|plane| self.samples(plane, step)));
        let pixel = |x: usize, y: usize| {
            let l = scale.luma(luma.at(x, y));
            match (&chroma, shares) {
                (None, _) => [l; 3],
                (Some([u, v]), None) => [scale.luma(v.at(x, y)), l, scale.luma(u.at(x, y))],
                (Some(planes), Some([red, blue])) => {
                    let [cb, cr] = planes.each_ref().map(|plane| scale.chroma(plane.between(x, y)));
                    let r = l + 2.0 * (1.0 - red) * cr;
                    let b = l + 2.0 * (1.0 - blue) * cb;
                    [r, (l - red * r - blue * b) / (1.0 - red - blue), b]
                }
            }
        };
        let [width, height] = self.size();
        let row = |y: usize| (0..width).map(|x| pixel(x, y)).collect::<Vec<_>>();
        Ok((0..height).into_par_iter().flat_map_iter(row).collect())
    }

    fn samples<'a>(&self, plane: &'a re_rav1d::dav1d::Plane, step: [usize; 2]) -> Samples<'a> {
        let [width, height] = self.size();
        let size = [width.div_ceil(step[0]), height.div_ceil(step[1])];
        let bytes: &[u8] = plane;
        Samples { bytes, stride: bytes.len() / size[1], wide: self.bits > 8, size, step }
    }
}

impl Samples<'_> {
    fn at(&self, x: usize, y: usize) -> f32 {
        let row = &self.bytes[y * self.stride..][..self.stride];
        if self.wide {
            f32::from(u16::from_ne_bytes([row[2 * x], row[2 * x + 1]]))
        } else {
            f32::from(row[x])
        }
    }

    /// Interpolated at a pixel of the frame; samples lie in the middle of the pixels that share them.
    fn between(&self, x: usize, y: usize) -> f32 {
        let place = |pixel: usize, axis: usize| {
            let step = self.step[axis] as f32;
            let last = (self.size[axis] - 1) as f32;
            let at = ((pixel as f32 + 0.5) / step - 0.5).clamp(0.0, last);
            (at as usize, (at as usize + 1).min(self.size[axis] - 1), at.fract())
        };
        let ((left, right, s), (top, bottom, t)) = (place(x, 0), place(y, 1));
        let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
        let line = |row: usize| mix(self.at(left, row), self.at(right, row), s);
        mix(line(top), line(bottom), t)
    }
}

/// From samples to Y′ in [0, 1] and Cb, Cr in [−½, ½].
struct Scale {
    black: f32,
    luma: f32,
    middle: f32,
    chroma: f32,
}

impl Scale {
    fn new(bits: usize, full_range: bool) -> Self {
        let unit = (1_u32 << (bits - 8)) as f32;
        let largest = ((1_u32 << bits) - 1) as f32;
        match full_range {
            true => Self { black: 0.0, luma: largest, middle: 128.0 * unit, chroma: largest },
            false => {
                Self { black: 16.0 * unit, luma: 219.0 * unit, middle: 128.0 * unit, chroma: 224.0 * unit }
            }
        }
    }

    fn luma(&self, sample: f32) -> f32 {
        (sample - self.black) / self.luma
    }

    fn chroma(&self, sample: f32) -> f32 {
        (sample - self.middle) / self.chroma
    }
}
