//! Latent optimisation: the code of an image under a fixed decoder, by Levenberg–Marquardt or Adam on the latent.
//!
//! Every image has its own latent Z [N, 3] and log exposure s: the decoded log radiance plus s is compared with
//! the image. s stays as it is unless it is asked to be free. An image may be a panorama, a part of one
//! ([`FitTarget::masked`]), or a view in any directions, clipped values included.

mod config;
mod decoder;
mod descent;
mod levenberg_marquardt;
mod linear;
mod linear_target;
mod lobes;
mod network;
mod pixel;
mod plateau;
mod rendered;
mod starts;
mod target;
#[cfg(test)]
mod tests;

pub use config::{FitConfig, Method, Objective, Plateau};
pub use decoder::{DecoderPasses, LatentDecoder, LatentGradient, PanoramaLoss};
pub use linear::{fit_linear, likely_linear, likely_searches};
pub use linear_target::{Achieved, LinearTarget, Received};
pub use lobes::{LobePlan, WIDEST_LIGHT, fit_lobes};
pub use rendered::{fit_rendered, matching_exposure};
pub use starts::{Best, best_light, best_linear, best_of, from_each, random_starts, refine_linear};
pub use target::FitTarget;

use crate::{Error, Result};
use descent::optimise;
use network::{ImageLoss, Network};
use pixel::PixelLoss;
use veni_light::latent::{Latent, Prior};

/// What came out.
#[derive(Clone, Debug, PartialEq)]
pub struct FitResult {
    /// One for each image, after the last update.
    pub latents: Vec<Latent>,
    /// The loss before each update, prior included, averaged over the images.
    pub losses: Vec<f64>,
    /// The loss of each image after the last update, without the prior.
    pub last: Vec<f64>,
}

/// Optimises one latent per image from `start`.
///
/// # Errors
/// [`Error::Invalid`] if the numbers of images and starts or their sizes disagree, if a value that counts is not finite,
/// or if the loss is no longer finite;
/// [`Error::Unsupported`] for an objective over whole images: [`fit_with`] takes those.
pub fn fit(
    decoder: &dyn LatentDecoder,
    target: &FitTarget<'_>,
    start: &[Latent],
    config: &FitConfig,
) -> Result<FitResult> {
    fit_with(decoder, target, start, config, None, &mut |_, _| {})
}

/// [`fit`] with a loss over whole images, which [`FitConfig::objective`] names, and a progress callback, which gets the
/// number of updates made and the loss, before each update.
///
/// # Errors
/// As [`fit`].
pub fn fit_with(
    decoder: &dyn LatentDecoder,
    target: &FitTarget<'_>,
    start: &[Latent],
    config: &FitConfig,
    loss: Option<&dyn PanoramaLoss>,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    config.check()?;
    target.check_finite()?;
    let n = decoder.latent_vectors();
    check_starts(start, target.count(), n)?;
    check_prior(target.prior(), n)?;
    let loss = match (loss, config.objective.is_pixelwise()) {
        (_, true) => ImageLoss::Pixels(PixelLoss::of_images(config.objective, target)),
        (Some(loss), false) => ImageLoss::Whole(loss),
        (None, false) => {
            return Err(Error::unsupported(
                "this objective is a loss over whole images, which only training has; use one that looks at each pixel \
                 alone, log-error for instance",
            ));
        }
    };
    let network = Network::new(decoder, target.directions());
    optimise(&network, &loss, target.prior(), start, config, observer)
}

fn check_starts(start: &[Latent], images: usize, n: usize) -> Result<()> {
    if start.len() != images {
        return Err(Error::invalid(format!("{images} images and {} latents to start from", start.len())));
    }
    if let Some(wrong) = start.iter().find(|z| z.vectors.len() != n) {
        return Err(Error::invalid(format!(
            "a start has {} vectors, the decoder takes {n}",
            wrong.vectors.len()
        )));
    }
    start.iter().try_for_each(Latent::check_finite)
}

fn check_prior(prior: Option<&Prior>, n: usize) -> Result<()> {
    match prior.map(Prior::latent_vectors) {
        Some(m) if m != n => Err(Error::invalid(format!("a prior of {m} vectors, the decoder takes {n}"))),
        _ => Ok(()),
    }
}
