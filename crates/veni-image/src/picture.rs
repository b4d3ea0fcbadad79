//! Pictures of any shape as linear radiance, with what is known of their pixels: photographs, parts of panoramas, masks.

use std::path::Path;

use crate::tonemap::srgb_to_linear;
use crate::{Error, LdrPanorama, Panorama, ReadOptions, Result, Transfer, luminance};

/// A display value from here on is taken for clipped.
const CLIPPED: f32 = 254.0 / 255.0;

/// A picture of linear radiance, and what is known about its pixels. Row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    size: [usize; 2],
    pixels: Vec<[f32; 3]>,
    known: Option<Vec<f32>>,
    clip: Option<f32>,
}

impl Picture {
    /// From linear radiance; a value that is not finite makes its pixel unknown.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are not W·H pixels, or none.
    pub fn new(size: [usize; 2], pixels: Vec<[f32; 3]>) -> Result<Self> {
        let [width, height] = size;
        let count = width * height;
        if count == 0 || pixels.len() != count {
            let pixels = pixels.len();
            return Err(Error::invalid(format!("a picture of {width} × {height} has {pixels} pixels")));
        }
        Ok(Self { size, pixels, known: None, clip: None })
    }

    /// How much of each pixel is known, 0 to 1 (NaN: nothing); times what was known before.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is not one value per pixel.
    pub fn masked(mut self, mask: &[f32]) -> Result<Self> {
        if mask.len() != self.pixels.len() {
            let [width, height] = self.size;
            return Err(Error::invalid(format!(
                "a picture of {width} × {height} has a mask of {} values",
                mask.len()
            )));
        }
        self.known = Some(match self.known.take() {
            Some(known) => known.iter().zip(mask).map(|(k, m)| k * m).collect(),
            None => mask.to_vec(),
        });
        Ok(self)
    }

    /// Values at or above `clip` are clipped: the truth is at least that.
    #[must_use]
    pub fn clipped_at(self, clip: f32) -> Self {
        Self { clip: Some(clip), ..self }
    }

    /// Reads a file of any format that this crate reads. What is transparent, or outside of an EXR file's data window, is
    /// unknown; display values are linearised by the sRGB curve, and their maximum counts as clipped.
    ///
    /// # Errors
    /// As [`Panorama::read_with`] and [`LdrPanorama::read_with`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let (path, options) = (path.as_ref(), any_aspect());
        if LdrPanorama::recognise(path)? {
            let image = LdrPanorama::read_with(path, &options)?;
            let size = [image.grid().width, image.grid().height];
            let known = image.alpha().map(<[f32]>::to_vec);
            let pixels = image.linear(Transfer::Srgb).into_pixels();
            return Ok(Self { size, pixels, known, clip: Some(srgb_to_linear(CLIPPED)) });
        }
        let image = Panorama::read_with(path, &options)?;
        let size = [image.grid().width, image.grid().height];
        let known = Panorama::read_alpha(path, &options)?.filter(|a| a.iter().any(|a| *a < 1.0));
        Ok(Self { size, pixels: image.into_pixels(), known, clip: None })
    }

    /// Width and height.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Linear radiance.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// How much of each pixel is known; absent: all of it.
    pub fn known(&self) -> Option<&[f32]> {
        self.known.as_deref()
    }

    /// Values at or above this are clipped.
    pub fn clip(&self) -> Option<f32> {
        self.clip
    }

    /// Whether some of its pixels are unknown.
    pub fn is_partial(&self) -> bool {
        let hidden = self.known.as_ref().is_some_and(|known| known.iter().any(|k| *k < 1.0));
        hidden || self.not_finite() > 0
    }

    /// Pixels with a value that is not finite.
    pub fn not_finite(&self) -> usize {
        self.pixels.iter().filter(|p| p.iter().any(|v| !v.is_finite())).count()
    }
}

/// A mask from a file: white is 1, black 0, and what is transparent is 0 too. PNG, JPEG, WebP as display values; EXR and
/// Radiance as they stand. Returns `[W, H]` and one value per pixel, row-major, from 0 to 1.
///
/// # Errors
/// As [`Picture::read`].
pub fn read_mask(path: impl AsRef<Path>) -> Result<([usize; 2], Vec<f32>)> {
    let (path, options) = (path.as_ref(), any_aspect());
    let (grid, values, alpha) = if LdrPanorama::recognise(path)? {
        let image = LdrPanorama::read_with(path, &options)?;
        (image.grid(), image.values().to_vec(), image.alpha().map(<[f32]>::to_vec))
    } else {
        let image = Panorama::read_with(path, &options)?;
        (image.grid(), image.into_pixels(), Panorama::read_alpha(path, &options)?)
    };
    // of grey the weights' sum could miss 1 by the last bit, and white must be known as a whole
    let grey = |[r, g, b]: [f32; 3]| if r == g && g == b { r } else { luminance([r, g, b]) };
    let mut mask: Vec<f32> = values.into_iter().map(|p| grey(p).clamp(0.0, 1.0)).collect();
    if let Some(alpha) = alpha {
        mask.iter_mut().zip(alpha).for_each(|(m, a)| *m *= a.clamp(0.0, 1.0));
    }
    Ok(([grid.width, grid.height], mask))
}

fn any_aspect() -> ReadOptions {
    ReadOptions { any_aspect: true, ..ReadOptions::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_multiply_and_sizes_must_agree() {
        let picture = Picture::new([2, 1], vec![[1.0; 3], [f32::NAN, 1.0, 1.0]]).unwrap();
        assert!(picture.is_partial() && picture.not_finite() == 1);
        let picture = picture.masked(&[0.5, 1.0]).unwrap().masked(&[0.5, 0.0]).unwrap();
        assert_eq!(picture.known(), Some(&[0.25, 0.0][..]));
        assert!(picture.masked(&[1.0]).unwrap_err().to_string().contains("mask of 1"));
        assert!(Picture::new([2, 2], vec![[1.0; 3]; 3]).is_err());
        assert!(Picture::new([0, 0], Vec::new()).is_err());
    }

    #[test]
    fn a_white_mask_is_known_as_a_whole_and_transparency_hides() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let pixels = [[255, 255, 255, 255], [255, 255, 255, 0], [0, 0, 0, 255], [128, 128, 128, 255]];
        let mut image = image::RgbaImage::new(4, 1);
        for (x, pixel) in (0..).zip(pixels) {
            image.put_pixel(x, 0, image::Rgba(pixel));
        }
        image.save(&path).unwrap();
        let (size, mask) = read_mask(&path).unwrap();
        assert_eq!((size, &mask[..3]), ([4, 1], &[1.0, 0.0, 0.0][..]));
        assert!((mask[3] - 128.0 / 255.0).abs() < 1e-6);
        // the same file as a picture: what is transparent is unknown
        let picture = Picture::read(&path).unwrap();
        assert_eq!(picture.known(), Some(&[1.0, 0.0, 1.0, 1.0][..]));
        assert!(picture.clip().is_some_and(|clip| clip < 1.0));
    }
}
