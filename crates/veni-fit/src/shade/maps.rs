//! Surfaces from image files: normal maps, masks, albedo.

use std::path::Path;

use super::unit::unit_f32;
use crate::{Error, Result};
use veni_image::{Content, Picture, ReadOptions};
use veni_light::vector::{length, narrow, wide};

/// A normal counts if its length lies strictly between these (MODEL, Rendered images).
const LENGTHS: [f64; 2] = [0.5, 1.5];
/// A length that is 1 as far as half precision and the interpolation within a face tell.
const UNIT: std::ops::RangeInclusive<f64> = 0.95..=1.05;

/// An image of normals, row-major, row 0 on top; (0, 0, 0) where nothing is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalMap {
    width: usize,
    height: usize,
    normals: Vec<[f32; 3]>,
}

impl NormalMap {
    /// From vectors of any length.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are not W·H of them.
    pub fn new([width, height]: [usize; 2], normals: Vec<[f32; 3]>) -> Result<Self> {
        if normals.len() != width * height {
            return Err(Error::invalid(format!("{} normals for {width} × {height} pixels", normals.len())));
        }
        Ok(Self { width, height, normals })
    }

    /// Reads an EXR or Radiance file, whose R, G, B are x, y, z as they stand, or a PNG (JPEG and WebP too, with
    /// their losses), which holds 127.5 (n + 1) per byte (32767.5 (n + 1) in 16 bits); its black and transparent pixels show
    /// nothing.
    ///
    /// # Errors
    /// [`Error::Invalid`], [`Error::Unsupported`] or [`Error::Io`] if the file is not such an image; [`Error::Invalid`] also for an
    /// EXR or Radiance file that looks coded 0 to 1 as a PNG is.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let mut stands = false;
        let (grid, mut normals, known) = match Content::read(path, &data())? {
            Content::Display(image) => {
                let decode =
                    |rgb: &[f32; 3]| if *rgb == [0.0; 3] { *rgb } else { rgb.map(|v| 2.0 * v - 1.0) };
                let normals: Vec<_> = image.values().iter().map(decode).collect();
                (image.grid(), normals, image.known().map(<[f32]>::to_vec))
            }
            Content::Radiance(image) => {
                let known = image.known().map(<[f32]>::to_vec);
                stands = true;
                (image.grid(), image.into_pixels(), known)
            }
        };
        let hidden = known.iter().flatten().zip(&mut normals).filter(|(known, _)| **known < 0.5);
        hidden.for_each(|(_, normal)| *normal = [0.0; 3]);
        let map = Self::new([grid.width, grid.height], normals);
        let refused = |map: &Self| if stands { map.refuse_coded() } else { Ok(()) };
        map.and_then(|map| refused(&map).map(|()| map)).map_err(|e| e.in_file(path))
    }

    /// Coded as (n + 1)/2, nothing is negative, and only normals whose components add up to 0 have a length of 1. Of a surface of which
    /// only sides towards +x, +y, +z are seen nothing is negative either, but all are of that length.
    fn refuse_coded(&self) -> Result<()> {
        let seen: Vec<_> = self.normals.iter().filter(|n| n.iter().any(|c| *c != 0.0)).collect();
        let unit = seen.iter().filter(|n| UNIT.contains(&length(wide(***n)))).count();
        let is_negative = seen.iter().any(|n| n.iter().any(|c| *c < 0.0));
        if is_negative || 2 * unit >= seen.len() {
            return Ok(());
        }
        Err(Error::invalid(format!(
            "no component of its {} normals is negative, and only {unit} are of length 1: it looks coded 0 to 1; decode it by \
             2v - 1",
            seen.len()
        )))
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The vectors as they are.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }

    /// The unit vector if the length is between 0.5 and 1.5, else `None`.
    pub fn valid(normal: [f32; 3]) -> Option<[f32; 3]> {
        let length = length(wide(normal));
        (length > LENGTHS[0] && length < LENGTHS[1]).then(|| unit_f32(normal)).flatten()
    }

    /// Another size, bilinearly between pixel centres, without averaging where the map shrinks: what the reference implementation does.
    /// Normals of an edge become too short to be [valid](Self::valid).
    #[must_use]
    pub fn resize(&self, width: usize, height: usize) -> Self {
        let columns = taps(self.width, width);
        let mut normals = Vec::with_capacity(width * height);
        for [(j0, wj0), (j1, wj1)] in taps(self.height, height) {
            for [(i0, wi0), (i1, wi1)] in &columns {
                let mut sum = [0.0; 3];
                for (j, wj) in [(j0, wj0), (j1, wj1)] {
                    for (i, wi) in [(i0, wi0), (i1, wi1)] {
                        let normal = wide(self.normals[j * self.width + i]);
                        (0..3).for_each(|c| sum[c] += wj * wi * normal[c]);
                    }
                }
                normals.push(narrow(sum));
            }
        }
        Self { width, height, normals }
    }
}

/// The two source pixels of each target pixel; the edge pixel is repeated outside.
fn taps(source: usize, target: usize) -> Vec<[(usize, f64); 2]> {
    let step = source as f64 / target as f64;
    (0..target)
        .map(|k| {
            let at = ((k as f64 + 0.5) * step - 0.5).clamp(0.0, (source - 1) as f64);
            let (low, part) = (at.floor() as usize, at.fract());
            [(low, 1.0 - part), ((low + 1).min(source - 1), part)]
        })
        .collect()
}

/// Reads a mask: a pixel belongs to the surface where its luminance (times alpha) is at least one half. Returns [W, H] and
/// the values, row-major.
///
/// # Errors
/// As [`veni_image::read_mask`].
pub fn read_mask(path: impl AsRef<Path>) -> Result<([usize; 2], Vec<bool>)> {
    let (size, mask) = veni_image::read_mask(path)?;
    Ok((size, mask.into_iter().map(|m| m >= 0.5).collect()))
}

/// Reads an albedo map as linear reflectance: colours as [`Content::read`] gives them, those of a display linearised as their
/// file says. Returns [W, H] and the colours, row-major.
///
/// # Errors
/// [`Error::Invalid`], [`Error::Unsupported`] or [`Error::Io`] if the file is not such an image.
pub fn read_albedo(path: impl AsRef<Path>) -> Result<([usize; 2], Vec<[f32; 3]>)> {
    let picture = Picture::read_with(path, &ReadOptions { data: false, ..data() })?;
    Ok((picture.size(), picture.pixels().to_vec()))
}

/// Numbers as they are stored; nothing (0, 0, 0) where half or more is hidden.
fn data() -> ReadOptions {
    ReadOptions { any_aspect: true, data: true, place_parts: false, ..ReadOptions::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_image::{Panorama, Precision, WriteFormat, WriteOptions};
    use veni_light::output::Overwrite;
    use veni_light::sphere::Equirect;

    #[test]
    fn lengths_decide_what_is_a_normal() {
        assert_eq!(NormalMap::valid([0.0, 0.0, 1.4]), Some([0.0, 0.0, 1.0]));
        for wrong in [[0.0, 0.5, 0.0], [0.0, 0.0, 1.5], [0.0; 3], [f32::NAN, 0.0, 1.0], [f32::INFINITY; 3]] {
            assert_eq!(NormalMap::valid(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn resizing_interpolates_between_centres() {
        let map = NormalMap::new([2, 1], vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]).unwrap();
        let wide = map.resize(4, 1);
        let expected = [[0.0, 0.0, 1.0], [0.25, 0.0, 0.75], [0.75, 0.0, 0.25], [1.0, 0.0, 0.0]];
        assert_eq!(wide.normals(), expected);
        assert_eq!(map.resize(1, 1).normals(), [[0.5, 0.0, 0.5]]);
        assert_eq!(map.resize(2, 1), map);
        let edge = NormalMap::new([2, 1], vec![[0.0; 3], [0.0, 1.0, 0.0]]).unwrap().resize(4, 1);
        let seen: Vec<_> = edge.normals().iter().map(|n| NormalMap::valid(*n).is_some()).collect();
        assert_eq!(seen, [false, false, true, true]);
        assert!(NormalMap::new([2, 2], vec![[0.0; 3]]).is_err());
    }

    #[test]
    fn normals_coded_from_0_to_1_are_refused_where_they_are_not_decoded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("n.exr");
        let options = WriteOptions {
            overwrite: Overwrite::Replace,
            ..WriteOptions::new(WriteFormat::Exr(Precision::Half))
        };
        let read = |normals: &[[f32; 3]]| {
            Panorama::new(Equirect::new(2, 2), normals.to_vec()).write(&path, &options).unwrap();
            NormalMap::read(&path)
        };
        // one of the four is of length 1 by chance
        let side = 0.5f32.sqrt();
        let normals = [[0.6, 0.0, 0.8], [0.0, 0.0, 1.0], [0.0, -0.6, -0.8], [side, 0.0, -side]];
        assert!(read(&normals).is_ok());
        let coded = normals.map(|n| n.map(|c| 0.5 * c + 0.5));
        let message = read(&coded).unwrap_err().to_string();
        assert!(message.contains("n.exr: no component of its 4 normals"), "{message}");
        assert!(message.contains("2v - 1"), "{message}");
        // what is black shows nothing, and says nothing of the rest
        assert!(read(&[coded[0], coded[1], [0.0; 3], [0.0; 3]]).is_err());
        // one octant is all that is seen, or nothing
        assert!(read(&[[0.0, 0.0, 1.0], [0.0; 3], [0.6, 0.8, 0.0], [1.0, 0.0, 0.0]]).is_ok());
        assert!(read(&[[0.0; 3]; 4]).is_ok());
    }

    #[test]
    fn files_come_back_as_what_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let (exr, png) = (folder.path().join("n.exr"), folder.path().join("n.png"));
        let normals =
            vec![[0.0, 0.0, -1.0], [0.6, -0.8, 0.0], [0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]];
        let options = WriteOptions {
            overwrite: Overwrite::Refuse,
            ..WriteOptions::new(WriteFormat::Exr(Precision::Float))
        };
        Panorama::new(Equirect::new(3, 2), normals.clone()).write(&exr, &options).unwrap();
        assert_eq!(NormalMap::read(&exr).unwrap(), NormalMap::new([3, 2], normals).unwrap());
        let pixels = image::RgbaImage::from_raw(2, 1, vec![128, 128, 255, 255, 9, 9, 9, 0]).unwrap();
        pixels.save(&png).unwrap();
        let map = NormalMap::read(&png).unwrap();
        assert!((map.normals()[0][2] - 1.0).abs() < 1e-6 && map.normals()[0][0].abs() < 5e-3);
        assert_eq!(map.normals()[1], [0.0; 3]);
        assert_eq!(read_mask(&png).unwrap(), ([2, 1], vec![true, false]));
        assert!((read_albedo(&png).unwrap().1[0][0] - 0.2158605).abs() < 1e-5);
        let text = folder.path().join("n.txt");
        std::fs::write(&text, "no image").unwrap();
        for error in [NormalMap::read(&text).err(), read_mask(&text).err(), read_albedo(&text).err()] {
            assert!(error.unwrap().to_string().contains("n.txt"));
        }
    }
}
