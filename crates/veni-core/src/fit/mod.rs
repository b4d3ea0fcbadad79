//! Latent optimisation with everything that burn adds to veni-fit: decoders as graphs of tensors, and the training losses
//! as objectives over whole images.

mod graph;
#[cfg(test)]
mod tests;
mod whole_loss;

pub use veni_fit::{
    Best, DecoderPasses, FitConfig, FitResult, FitTarget, LatentDecoder, LatentGradient, Method, Objective,
    Observation, PanoramaLoss, Plateau, fit_rendered, from_each, loss, matching_exposure, random_starts,
    schedule, shade,
};

use burn::tensor::Device;
use veni_light::field;
use veni_light::latent::Latent;

use crate::{Result, vae};
use whole_loss::WholeLoss;

/// A decoder under which latents are optimised; its weights are constants.
#[derive(Clone, Copy, Debug)]
pub enum FitDecoder<'a> {
    /// The decoder folded per latent, with its gradient in closed form: the fast way.
    Folded(&'a field::Decoder),
    /// The decoder as a graph of tensors on its device: every kind of decoder, every floating-point type.
    Graph(&'a vae::Decoder),
}

impl<'a> From<&'a field::Decoder> for FitDecoder<'a> {
    fn from(decoder: &'a field::Decoder) -> Self {
        Self::Folded(decoder)
    }
}

impl<'a> From<&'a vae::Decoder> for FitDecoder<'a> {
    fn from(decoder: &'a vae::Decoder) -> Self {
        Self::Graph(decoder)
    }
}

impl<'a> FitDecoder<'a> {
    /// As veni-fit takes it.
    pub fn as_dyn(self) -> &'a dyn LatentDecoder {
        match self {
            Self::Folded(decoder) => decoder,
            Self::Graph(decoder) => decoder,
        }
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(self) -> usize {
        self.as_dyn().latent_vectors()
    }

    /// Where losses over whole images are computed.
    fn device(self) -> Device {
        match self {
            Self::Folded(_) => Device::flex().autodiff(),
            Self::Graph(decoder) => graph::autodiff_device(decoder),
        }
    }
}

/// Optimises one latent per image from `start`, under any objective.
///
/// # Errors
/// As [`veni_fit::fit`]; and if the objective cannot take the masks, clipped values or views that are given.
pub fn fit<'a>(
    decoder: impl Into<FitDecoder<'a>>,
    target: &FitTarget<'_>,
    start: &[Latent],
    config: &FitConfig,
) -> Result<FitResult> {
    fit_observed(decoder, target, start, config, &mut |_, _| {})
}

/// [`fit`] with a progress callback, which gets the number of updates made and the loss, before each update.
///
/// # Errors
/// As [`fit`].
pub fn fit_observed<'a>(
    decoder: impl Into<FitDecoder<'a>>,
    target: &FitTarget<'_>,
    start: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    let decoder = decoder.into();
    let whole = WholeLoss::new(config, target, &decoder.device())?;
    let whole = whole.as_ref().map(|loss| loss as &dyn PanoramaLoss);
    veni_fit::fit_with(decoder.as_dyn(), target, start, config, whole, observer)
}

/// [`veni_fit::best_of`] under any objective.
///
/// # Errors
/// As [`fit`].
///
/// # Panics
/// If there is no start, or not exactly one image.
pub fn best_of<'a>(
    decoder: impl Into<FitDecoder<'a>>,
    target: &FitTarget<'_>,
    starts: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<Best> {
    assert!(target.count() == 1, "one image");
    let decoder = decoder.into();
    from_each(starts, config, observer, |start, observer| {
        fit_observed(decoder, target, start, config, observer)
    })
}
