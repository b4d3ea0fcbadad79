//! What is fitted: pixels whose direction and log radiance are known.

use std::borrow::Cow;

use veni_light::latent::Prior;
use veni_light::sphere::Equirect;

use crate::{Error, Result};

/// Images to be fitted, all in the same directions. Each step of the construction checks what it adds, so that a target is
/// consistent however it was made.
///
/// ```
/// use veni_fit::FitTarget;
/// use veni_light::sphere::Equirect;
///
/// let grid = Equirect::new(4, 2);
/// let (image, mask) = (vec![0.0; 3 * 8], vec![1.0; 8]);
/// let target = FitTarget::panoramas(grid, &[&image])?.masked(&[&mask])?;
/// assert_eq!(target.count(), 1);
/// assert!(FitTarget::panoramas(grid, &[&image[1..]]).is_err());
/// # Ok::<(), veni_fit::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct FitTarget<'a> {
    grid: Equirect,
    /// Directions and areas of the pixels, where they are not exactly those of the grid.
    view: Option<View<'a>>,
    images: Vec<TargetImage<'a>>,
    prior: Option<&'a Prior>,
}

#[derive(Clone, Debug)]
struct View<'a> {
    directions: Cow<'a, [[f32; 3]]>,
    areas: Option<Cow<'a, [f32]>>,
}

/// One image of a target.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TargetImage<'a> {
    /// Log radiance, 3·W·H values.
    pub(crate) log_radiance: &'a [f32],
    /// How much each pixel counts, W·H values, 0 where unknown; absent: all count.
    pub(crate) mask: Option<&'a [f32]>,
    /// Which values are clipped, 3·W·H: the truth is at least the image's value, and only a prediction below it counts.
    pub(crate) clipped: Option<&'a [bool]>,
}

impl<'a> FitTarget<'a> {
    /// Whole panoramas of log radiance, 3·W·H values each.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is none, or one has another size.
    pub fn panoramas(grid: Equirect, images: &[&'a [f32]]) -> Result<Self> {
        let pixels = grid.len();
        if images.is_empty() {
            return Err(Error::invalid("0 images to fit"));
        }
        if let Some(wrong) = images.iter().find(|image| image.len() != 3 * pixels) {
            return Err(Error::invalid(format!(
                "an image has {} values, its grid {pixels} pixels",
                wrong.len()
            )));
        }
        let image = |log_radiance: &&'a [f32]| TargetImage { log_radiance, mask: None, clipped: None };
        Ok(Self { grid, view: None, images: images.iter().map(image).collect(), prior: None })
    }

    /// Pixels that look in these unit directions, row-major: a perspective view, for instance; `areas` is the area of each
    /// in any unit (usually solid angle), and where it is absent those of the grid are taken.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is not one for each pixel, or an area is negative, not finite, or all are 0.
    pub fn in_directions(
        mut self,
        directions: impl Into<Cow<'a, [[f32; 3]]>>,
        areas: Option<&'a [f32]>,
    ) -> Result<Self> {
        let (directions, pixels) = (directions.into(), self.grid.len());
        if directions.len() != pixels {
            return Err(Error::invalid(format!("{} directions for {pixels} pixels", directions.len())));
        }
        if let Some(areas) = areas {
            let bad = areas.iter().find(|a| !(a.is_finite() && **a >= 0.0));
            if areas.len() != pixels || bad.is_some() || areas.iter().sum::<f32>() == 0.0 {
                return Err(Error::invalid(format!(
                    "{pixels} pixels need as many finite areas of at least 0, and not all 0"
                )));
            }
        }
        self.view = Some(View { directions, areas: areas.map(Cow::Borrowed) });
        Ok(self)
    }

    /// How much each pixel counts, W·H values per image, 0 where unknown.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is not one mask of the grid's size per image, or one covers nothing or has negative values.
    pub fn masked(mut self, masks: &[&'a [f32]]) -> Result<Self> {
        let (images, pixels) = (self.images.len(), self.grid.len());
        if masks.len() != images || masks.iter().any(|m| m.len() != pixels) {
            return Err(Error::invalid(format!(
                "{images} images of {pixels} pixels need as many masks of that size"
            )));
        }
        if masks.iter().any(|m| !(m.iter().sum::<f32>() > 0.0 && m.iter().all(|v| *v >= 0.0))) {
            return Err(Error::invalid("a mask covers nothing, or has negative values"));
        }
        self.images.iter_mut().zip(masks).for_each(|(image, mask)| image.mask = Some(mask));
        Ok(self)
    }

    /// Which values are clipped, 3·W·H per image: the truth is at least the image's value, and only a prediction below it
    /// counts.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is not one list of the grid's size per image.
    pub fn clipped(mut self, clipped: &[&'a [bool]]) -> Result<Self> {
        let (images, pixels) = (self.images.len(), self.grid.len());
        if clipped.len() != images || clipped.iter().any(|c| c.len() != 3 * pixels) {
            return Err(Error::invalid(format!(
                "{images} images of {pixels} pixels need as many lists of {} clipped values",
                3 * pixels
            )));
        }
        self.images.iter_mut().zip(clipped).for_each(|(image, clipped)| image.clipped = Some(clipped));
        Ok(self)
    }

    /// Which latents are likely, for [`FitConfig::prior`](super::FitConfig::prior); without, standard normal.
    #[must_use]
    pub fn with_prior(self, prior: &'a Prior) -> Self {
        Self { prior: Some(prior), ..self }
    }

    /// Width and height of every image.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// The number of images.
    pub fn count(&self) -> usize {
        self.images.len()
    }

    /// Log radiance of image `b`, 3·W·H values.
    ///
    /// # Panics
    /// If there are fewer images.
    pub fn image(&self, b: usize) -> &'a [f32] {
        self.images[b].log_radiance
    }

    /// Whether these are whole panoramas of the grid, not pixels in directions of their own.
    pub fn is_panoramic(&self) -> bool {
        self.view.is_none()
    }

    /// Whether there are masks or clipped values.
    pub fn is_partial(&self) -> bool {
        self.images.iter().any(|image| image.mask.is_some() || image.clipped.is_some())
    }

    /// The prior over latents, if one was given.
    pub fn prior(&self) -> Option<&'a Prior> {
        self.prior
    }

    pub(super) fn images(&self) -> &[TargetImage<'a>] {
        &self.images
    }

    /// The direction of every pixel.
    pub(super) fn directions(&self) -> Vec<[f32; 3]> {
        self.view.as_ref().map_or_else(|| self.grid.directions(), |view| view.directions.to_vec())
    }

    /// The area of every pixel.
    pub(super) fn areas(&self) -> Vec<f64> {
        match self.view.as_ref().and_then(|view| view.areas.as_ref()) {
            Some(areas) => areas.iter().map(|a| f64::from(*a)).collect(),
            None => {
                let rows = 0..self.grid.height;
                rows.flat_map(|j| std::iter::repeat_n(self.grid.polar(j).sin(), self.grid.width)).collect()
            }
        }
    }

    /// The smallest angle between neighbouring pixels in the middle of the images, radians.
    pub(super) fn spacing(&self) -> f32 {
        let Equirect { width, height } = self.grid;
        let directions = self.directions();
        let middle = height / 2 * width + width / 2;
        let beside = [width > 1, height > 1].into_iter().zip([1, width]).filter(|(is, _)| *is);
        let angle = |step: usize| -> f32 {
            // the chord is exact where the cosine has no digits left
            let pair = directions[middle].iter().zip(&directions[middle - step]);
            pair.map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt()
        };
        beside.map(|(_, step)| angle(step)).fold(std::f32::consts::PI, f32::min)
    }

    /// That every value that counts is finite: last, since where nothing counts anything may stand.
    pub(super) fn check_finite(&self) -> Result<()> {
        for (b, TargetImage { log_radiance, mask, .. }) in self.images.iter().enumerate() {
            let counts = |p: usize| mask.is_none_or(|mask| mask[p] > 0.0);
            if let Some(k) = (0..log_radiance.len()).find(|k| !log_radiance[*k].is_finite() && counts(k / 3))
            {
                return Err(Error::invalid(format!(
                    "image {b}, pixel {} is {} in log radiance; mask it or sanitise the image",
                    k / 3,
                    log_radiance[k]
                )));
            }
        }
        Ok(())
    }
}
