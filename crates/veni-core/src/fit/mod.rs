//! Latent optimisation: the code of an image under a fixed decoder, by Levenberg–Marquardt or Adam on the latent.
//!
//! Every image has its own latent Z [N, 3] and log exposure s: the decoded log radiance plus s is compared with
//! the image. s stays as it is unless it is asked to be free. An image may be a panorama, a part of one
//! ([`FitTarget::masks`]), or a view in any directions, clipped values included.

mod adam;
mod config;
mod descent;
mod levenberg_marquardt;
mod network;
mod observation;
mod pixel;
mod shaded;
mod stall;
mod starts;
mod target;
#[cfg(test)]
mod tests;
mod whole;

pub use config::{FitConfig, Method, Objective, Plateau};
pub use network::FitDecoder;
pub use observation::{Observation, Picture};
pub use shaded::{fit_shaded, matching_exposure};
pub use starts::{Best, best_light, best_of, random_starts};
pub use target::FitTarget;

use crate::latent::{Latent, Prior};
use crate::{Error, Result};
use descent::optimise;
use network::{ImageLoss, Network};
use pixel::PixelLoss;
use whole::WholeLoss;

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
/// [`Error::Invalid`] if the numbers of images, masks and starts or their sizes disagree, if there are none,
/// if the objective cannot take masks or clipped values that are given, or if the loss is no longer finite.
pub fn fit<'a>(
    decoder: impl Into<FitDecoder<'a>>,
    target: &FitTarget<'_>,
    start: &[Latent],
    config: &FitConfig,
) -> Result<FitResult> {
    fit_watched(decoder, target, start, config, &mut |_, _| {})
}

/// [`fit`], telling `watch` the number of updates made and the loss, before each update.
///
/// # Errors
/// As [`fit`].
pub fn fit_watched<'a>(
    decoder: impl Into<FitDecoder<'a>>,
    target: &FitTarget<'_>,
    start: &[Latent],
    config: &FitConfig,
    watch: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    let decoder = decoder.into();
    config.check()?;
    target.check()?;
    let n = decoder.latent_vectors();
    check_starts(start, target.images.len(), n)?;
    check_prior(target.prior, n)?;
    let loss = image_loss(decoder, target, config)?;
    let network = Network::new(decoder, target.directions());
    optimise(&network, &loss, target.prior, start, config, watch)
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

fn image_loss<'a>(
    decoder: FitDecoder<'_>,
    target: &FitTarget<'a>,
    config: &FitConfig,
) -> Result<ImageLoss<'a>> {
    if let Some(whole) = WholeLoss::new(config, target, &decoder.device())? {
        return Ok(ImageLoss::Whole(whole));
    }
    let areas = target.areas();
    let images = (0..target.images.len()).map(|b| PixelLoss::new(config.objective, target, b, &areas));
    Ok(ImageLoss::Pixels(images.flatten().collect()))
}
