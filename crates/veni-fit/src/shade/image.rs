//! A photograph of a known surface, and how well a light explains it.

use super::loss::Comparison;
use super::{RenderingLoss, Transfer};
use crate::Result;

/// What the number `log_exposure` = s does to the light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExposureForm {
    /// Radiance times e^s.
    #[default]
    Natural,
    /// The reference implementation exponentiates twice: radiance times exp(e^s), never below 1 (MODEL, Rendered images).
    Reference,
}

impl ExposureForm {
    /// What is added to log radiance, and its derivative with respect to s.
    fn offset(self, s: f32) -> (f32, f64) {
        match self {
            Self::Natural => (s, 1.0),
            Self::Reference => (s.exp(), f64::from(s).exp()),
        }
    }
}

/// A loss ([`f64`]), its gradient with respect to the log radiance of every light, and with respect to s.
pub type LossAndGradients = (f64, Vec<[f32; 3]>, f64);

/// A target image with its [`Transfer`]: a function of the light with its gradient.
///
/// The light is natural-log radiance [L, 3] in the order of [`Transfer::lights`], which for [`DistantLights::equirect`] is
/// what the decoder gives for [`Equirect::directions`]. A fit multiplies the gradient with the decoder's own:
///
/// ```
/// # use veni_fit::shade::*;
/// # use veni_light::sphere::Equirect;
/// # fn main() -> veni_light::Result<()> {
/// let grid = Equirect::new(16, 8);
/// let ball = ([0.0; 3], 1.0);
/// let camera = Camera::framing(ball, [0.0; 2], REFERENCE_FIELD_OF_VIEW, [24, 24], 0.05)?;
/// let surface = Surface::sphere(&camera, ball, 24, 24)?;
/// let material = Material::blinn_phong(Colour::Uniform([1.0; 3]), 0.2, 50.0);
/// let transfer = Transfer::new(&surface, &material, DistantLights::equirect(grid), ShadingForm::Physical)?;
/// let photograph = transfer.render(&vec![[2.0, 1.0, 0.5]; grid.len()]);
///
/// let image = RenderedImage::new(transfer, &photograph, RenderingLoss::default())?;
/// let log_radiance = vec![[0.0; 3]; grid.len()]; // a decoder's output
/// let (loss, gradient, by_exposure) = image.evaluate(&log_radiance, 0.0);
/// // the light should be redder, which is to say: more of channel 0, less of channel 2
/// assert!(loss > 0.0 && gradient[0][0] < 0.0 && gradient[0][2] > 0.0);
/// # let _ = by_exposure;
/// # Ok(()) }
/// ```
///
/// [`DistantLights::equirect`]: super::DistantLights::equirect
/// [`Equirect::directions`]: veni_light::sphere::Equirect::directions
#[derive(Clone, Debug)]
pub struct RenderedImage {
    transfer: Transfer,
    comparison: Comparison,
    exposure: ExposureForm,
}

impl RenderedImage {
    /// A target of linear radiance [H·W, 3], row-major. Only pixels count that show the surface and whose target is
    /// finite.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) if the target is of another size, if nothing of it counts, if it is black,
    /// or if the loss cannot be taken of it.
    pub fn new(transfer: Transfer, target: &[[f32; 3]], loss: RenderingLoss) -> Result<Self> {
        let comparison = Comparison::new(loss, &transfer, target)?;
        Ok(Self { transfer, comparison, exposure: ExposureForm::default() })
    }

    /// The same with another meaning of s.
    #[must_use]
    pub fn with_exposure(self, exposure: ExposureForm) -> Self {
        Self { exposure, ..self }
    }

    /// Everything but the light.
    pub fn transfer(&self) -> &Transfer {
        &self.transfer
    }

    /// The image [H·W, 3] of this light.
    ///
    /// # Panics
    /// If there is not one log radiance per light.
    pub fn render(&self, log_radiance: &[[f32; 3]], log_exposure: f32) -> Vec<[f32; 3]> {
        self.transfer.render(&self.radiance(log_radiance, log_exposure))
    }

    /// The loss of this light, its gradient with respect to the log radiance [L, 3] and to the log exposure, in one pass
    /// over the transfer matrix. Without noise from threads: the same input gives the same bits.
    ///
    /// Light too bright for an f32 makes the loss infinite or NaN; a fit must look at it.
    ///
    /// # Panics
    /// If there is not one log radiance per light.
    pub fn evaluate(&self, log_radiance: &[[f32; 3]], log_exposure: f32) -> LossAndGradients {
        let radiance = self.radiance(log_radiance, log_exposure);
        let light = self.transfer.planes(&radiance);
        let (loss, mut gradient) =
            self.transfer.evaluate(&light, |at, value| self.comparison.pixel(at, value));
        let mut total = 0.0;
        for (g, radiance) in gradient.iter_mut().zip(&radiance) {
            for (g, radiance) in g.iter_mut().zip(radiance) {
                *g *= radiance;
                total += f64::from(*g);
            }
        }
        (loss, gradient, total * self.exposure.offset(log_exposure).1)
    }

    /// The parts of [`RenderingLoss::ReferenceDisplay`], unweighted: mean squared display error, and 1 − mean cosine. `None`
    /// with another loss.
    ///
    /// # Panics
    /// If there is not one log radiance per light.
    #[doc(hidden)]
    pub fn display_terms(&self, log_radiance: &[[f32; 3]], log_exposure: f32) -> Option<[f64; 2]> {
        self.comparison.display_terms(&self.render(log_radiance, log_exposure))
    }

    fn radiance(&self, log_radiance: &[[f32; 3]], log_exposure: f32) -> Vec<[f32; 3]> {
        let offset = self.exposure.offset(log_exposure).0;
        log_radiance.iter().map(|pixel| pixel.map(|v| (v + offset).exp())).collect()
    }
}
