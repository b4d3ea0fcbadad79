//! What is fitted: pixels whose direction and log radiance are known.

use veni_light::latent::Prior;
use veni_light::sphere::Equirect;
use crate::{Error, Result};

/// Images to be fitted, all in the same directions.
#[derive(Clone, Debug)]
pub struct FitTarget<'a> {
    /// Width and height; the panorama's pixels, unless `directions` says otherwise.
    pub grid: Equirect,
    /// Unit directions of the pixels, row-major, if they are not exactly those of the grid: a perspective view,
    /// for instance.
    pub directions: Option<&'a [[f32; 3]]>,
    /// Area of each pixel in any unit (usually solid angle), W·H values; absent: those of the grid.
    pub areas: Option<&'a [f32]>,
    /// Log radiance, 3·W·H values each.
    pub images: &'a [&'a [f32]],
    /// How much each pixel counts, W·H values per image, 0 where unknown; absent: all count.
    pub masks: Option<&'a [&'a [f32]]>,
    /// Which values are clipped, 3·W·H per image: the truth is at least the image's value, and only a
    /// prediction below it counts. Absent: none.
    pub clipped: Option<&'a [&'a [bool]]>,
    /// Which latents are likely, for [`FitConfig::prior`](super::FitConfig::prior); absent: standard normal.
    pub prior: Option<&'a Prior>,
}

impl<'a> FitTarget<'a> {
    /// Whole panoramas.
    pub fn panoramas(grid: Equirect, images: &'a [&'a [f32]]) -> Self {
        Self { grid, directions: None, areas: None, images, masks: None, clipped: None, prior: None }
    }

    /// The direction of every pixel.
    pub(super) fn directions(&self) -> Vec<[f32; 3]> {
        self.directions.map_or_else(|| self.grid.directions(), <[_]>::to_vec)
    }

    /// The area of every pixel.
    pub(super) fn areas(&self) -> Vec<f64> {
        match self.areas {
            Some(areas) => areas.iter().map(|a| f64::from(*a)).collect(),
            None => {
                let rows = 0..self.grid.height;
                rows.flat_map(|j| std::iter::repeat_n(self.grid.polar(j).sin(), self.grid.width)).collect()
            }
        }
    }

    /// Checks that the numbers fit together.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming what does not.
    pub fn check(&self) -> Result<()> {
        let (images, pixels) = (self.images.len(), self.grid.len());
        if images == 0 {
            return Err(Error::invalid("0 images to fit"));
        }
        if let Some(wrong) = self.images.iter().find(|image| image.len() != 3 * pixels) {
            return Err(Error::invalid(format!(
                "an image has {} values, its grid {pixels} pixels",
                wrong.len()
            )));
        }
        if let Some(directions) = self.directions.filter(|d| d.len() != pixels) {
            return Err(Error::invalid(format!("{} directions for {pixels} pixels", directions.len())));
        }
        if let Some(areas) = self.areas {
            let bad = areas.iter().find(|a| !(a.is_finite() && **a >= 0.0));
            if areas.len() != pixels || bad.is_some() || areas.iter().sum::<f32>() == 0.0 {
                return Err(Error::invalid(format!(
                    "{pixels} pixels need as many finite areas of at least 0, and not all 0"
                )));
            }
        }
        if let Some(masks) = self.masks {
            if masks.len() != images || masks.iter().any(|m| m.len() != pixels) {
                return Err(Error::invalid(format!(
                    "{images} images of {pixels} pixels need as many masks of that size"
                )));
            }
            if masks.iter().any(|m| !(m.iter().sum::<f32>() > 0.0 && m.iter().all(|v| *v >= 0.0))) {
                return Err(Error::invalid("a mask covers nothing, or has negative values"));
            }
        }
        if let Some(clipped) = self.clipped
            && (clipped.len() != images || clipped.iter().any(|c| c.len() != 3 * pixels))
        {
            return Err(Error::invalid(format!(
                "{images} images of {pixels} pixels need as many lists of {} clipped values",
                3 * pixels
            )));
        }
        // where nothing counts, anything may stand
        let counts = |b: usize, p: usize| self.masks.is_none_or(|masks| masks[b][p] > 0.0);
        for (b, image) in self.images.iter().enumerate() {
            if let Some(k) = (0..3 * pixels).find(|k| !image[*k].is_finite() && counts(b, k / 3)) {
                return Err(Error::invalid(format!(
                    "image {b}, pixel {} is {} in log radiance; mask it or sanitise the image",
                    k / 3,
                    image[k]
                )));
            }
        }
        Ok(())
    }
}
