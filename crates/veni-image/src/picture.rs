//! Pictures of any shape as linear radiance, with what is known of their pixels: photographs, parts of panoramas, masks.

use std::path::Path;

use crate::{Content, Error, ReadOptions, Result, TransferFunction, luminance};

/// A display value from here on is taken for clipped.
const CLIPPED: f32 = 254.0 / 255.0;

/// A picture of linear radiance, and what is known about its pixels. Row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    size: [usize; 2],
    pixels: Vec<[f32; 3]>,
    known: Option<Vec<f32>>,
    clip: Option<f32>,
    notes: Vec<String>,
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
        Ok(Self { size, pixels, known: None, clip: None, notes: Vec::new() })
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
        let mask = mask.iter().map(|m| if m.is_nan() { 0.0 } else { *m });
        self.known = Some(match self.known.take() {
            Some(known) => known.iter().zip(mask).map(|(k, m)| k * m).collect(),
            None => mask.collect(),
        });
        Ok(self)
    }

    /// Values at or above `clip` are clipped: the truth is at least that.
    #[must_use]
    pub fn clipped_at(self, clip: f32) -> Self {
        Self { clip: Some(clip), ..self }
    }

    /// [`Picture::read_with`] without wishes; any width and height.
    ///
    /// # Errors
    /// As [`Content::read`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        Self::read_with(path, &any_aspect())
    }

    /// Reads a file of any format that this crate reads. What is transparent, or outside of what an EXR file or a part of a
    /// panorama holds, is unknown; display values are linearised as the file says, and their maximum counts as clipped.
    ///
    /// # Errors
    /// As [`Content::read`].
    pub fn read_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let (panorama, clip) = match Content::read(path, options)? {
            Content::Radiance(panorama) => (panorama, None),
            Content::Display(image) => {
                let clip = image.linear_value(CLIPPED);
                (image.linear(TransferFunction::Srgb), Some(clip))
            }
        };
        let size = [panorama.grid.width, panorama.grid.height];
        let crate::Panorama { pixels, known, notes, .. } = panorama;
        let picture = Self { size, pixels, known, clip: None, notes };
        Ok(match clip {
            Some(clip) => picture.clipped_at(clip),
            None => picture,
        })
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

    /// What its file says that is not applied, or is worth knowing; sentences without the file's name.
    pub fn notes(&self) -> &[String] {
        &self.notes
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

/// [`read_mask_with`] without wishes; any width and height.
///
/// # Errors
/// As [`read_mask_with`].
pub fn read_mask(path: impl AsRef<Path>) -> Result<([usize; 2], Vec<f32>)> {
    read_mask_with(path, &any_aspect())
}

/// A mask from a file: white is 1, black 0, and what is transparent or not a number is 0 too. PNG, JPEG, WebP as display values; EXR and
/// Radiance as they stand, [`ReadOptions::data`] or not. Returns `[W, H]` and one value per pixel, row-major, from 0 to 1.
///
/// # Errors
/// As [`Picture::read_with`]; [`Error::Invalid`] if the largest display value is the smallest above black, as of truth values (0 and
/// 1) that were saved as they are: such a mask has no white.
pub fn read_mask_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<([usize; 2], Vec<f32>)> {
    let options = ReadOptions { data: true, ..options.clone() };
    let path = path.as_ref();
    let (grid, values, alpha) = match Content::read(path, &options)? {
        Content::Display(image) => {
            let largest = image.values.as_flattened().iter().copied().fold(0.0, f32::max);
            let is_one = |white: &f32| (largest * white - 1.0).abs() < 1e-3;
            if let Some(white) = [255.0, 65535.0].into_iter().find(is_one) {
                return Err(Error::invalid(format!(
                    "the largest value of the mask is 1 of {white}: a mask is white, {white}, where something is known"
                ))
                .in_file(path));
            }
            (image.grid(), image.values, image.known)
        }
        Content::Radiance(image) => (image.grid(), image.pixels, image.known),
    };
    // of grey the weights' sum could miss 1 by the last bit, and white must be known as a whole
    let grey = |[r, g, b]: [f32; 3]| if r == g && g == b { r } else { luminance([r, g, b]) };
    // NaN survives being clamped, but is not the larger of two
    let share = |v: f32| v.clamp(0.0, 1.0).max(0.0);
    let mut mask: Vec<f32> = values.into_iter().map(|p| share(grey(p))).collect();
    if let Some(alpha) = alpha {
        mask.iter_mut().zip(alpha).for_each(|(m, a)| *m *= share(a));
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
        let picture = Picture::new([2, 1], vec![[1.0; 3]; 2]).unwrap().masked(&[1.0, f32::NAN]).unwrap();
        assert!(picture.known() == Some(&[1.0, 0.0][..]) && picture.is_partial());
        assert!(Picture::new([2, 2], vec![[1.0; 3]; 3]).is_err());
        assert!(Picture::new([0, 0], Vec::new()).is_err());
    }

    #[test]
    fn truth_values_in_place_of_white_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let grey =
            |bytes: [u8; 2]| image::GrayImage::from_raw(2, 1, bytes.to_vec()).unwrap().save(&path).unwrap();
        grey([0, 1]);
        let message = read_mask(&path).unwrap_err().to_string();
        assert!(message.contains("mask.png: the largest value of the mask is 1 of 255"), "{message}");
        for (values, mask) in
            [([0, 2], [0.0, 2.0 / 255.0]), ([0, 0], [0.0; 2]), ([1, 255], [1.0 / 255.0, 1.0])]
        {
            grey(values);
            assert_eq!(read_mask(&path).unwrap().1, mask);
        }
        let wide = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0, 1]).unwrap();
        wide.save(&path).unwrap();
        assert!(read_mask(&path).unwrap_err().to_string().contains("is 1 of 65535"));
    }

    #[test]
    fn what_is_not_a_number_in_a_mask_is_unknown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.exr");
        let values = [1.0, f32::NAN, 0.25, f32::INFINITY];
        exr::prelude::write_rgb_file(&path, 4, 1, |x, _| (values[x], values[x], values[x])).unwrap();
        assert_eq!(read_mask(&path).unwrap(), ([4, 1], vec![1.0, 0.0, 0.25, 1.0]));
        // in one channel alone
        exr::prelude::write_rgb_file(&path, 4, 1, |x, _| (1.0f32, values[x], 1.0f32)).unwrap();
        assert_eq!(read_mask(&path).unwrap().1[..2], [1.0, 0.0]);
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
