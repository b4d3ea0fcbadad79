//! Latent optimisation: the code of an image under a fixed decoder, by Adam on the latent.
//!
//! Every image has its own latent Z [N, 3] and log exposure s: the decoded log radiance plus s is compared with
//! the image. s stays as it is unless it is asked to be free. An image may be a panorama, a part of one
//! ([`FitTarget::masks`]), or a view in any directions, clipped values included.

mod adam;
mod config;
mod network;
mod observation;
mod pixel;
mod shaded;
mod starts;
mod target;
#[cfg(test)]
mod tests;
mod whole;

pub use config::{FitConfig, Objective, Plateau};
pub use network::FitDecoder;
pub use observation::{Observation, Picture};
pub use shaded::{fit_shaded, matching_exposure};
pub use starts::{Best, best_light, best_of, random_starts};
pub use target::FitTarget;

use crate::latent::{Latent, Prior};
use crate::{Error, Result};
use adam::Variable;
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

/// Adam on latents and exposures.
fn optimise(
    network: &Network<'_>,
    loss: &ImageLoss<'_>,
    prior: Option<&Prior>,
    start: &[Latent],
    config: &FitConfig,
    watch: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    let n = start.first().map_or(0, |z| z.vectors.len());
    let flat = start.iter().flat_map(|z| z.vectors.as_flattened()).copied();
    let mut vectors = Variable::new(flat.collect(), config.epsilon);
    let mut exposures = Variable::new(start.iter().map(|z| z.log_exposure).collect(), config.epsilon);
    let mut losses = Vec::with_capacity(config.steps as usize);
    let mut stall = Stall::new(config.plateau, start.len());
    for step in 0..config.steps {
        let mut found = network.evaluate(&latents(&vectors, &exposures, n), loss)?;
        add_prior(config.prior, prior, &vectors.values, n, &mut found);
        let value = found.losses.iter().sum::<f64>() / found.losses.len() as f64;
        if !value.is_finite() {
            return Err(Error::invalid(format!(
                "the fit's loss is {value} at step {step}; lower its learning rate"
            )));
        }
        watch(step, value);
        losses.push(value);
        if stall.ended(&found.losses) {
            break;
        }
        let rate = config.learning_rate.at(step);
        vectors.update(&found.vectors, rate, step + 1);
        if config.free_exposure {
            exposures.update(&found.exposures, rate, step + 1);
        }
    }
    let latents = latents(&vectors, &exposures, n);
    let last = network.losses(&latents, loss)?;
    Ok(FitResult { latents, losses, last })
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

fn latents(vectors: &Variable, exposures: &Variable, n: usize) -> Vec<Latent> {
    let vectors = vectors.values.as_chunks().0.chunks_exact(n).map(<[[f32; 3]]>::to_vec);
    let both = vectors.zip(&exposures.values);
    both.map(|(v, log_exposure)| Latent { log_exposure: *log_exposure, ..Latent::new(v) }).collect()
}

/// weight/N · (−ln p) of every latent, and its slope.
fn add_prior(weight: f64, prior: Option<&Prior>, vectors: &[f32], n: usize, found: &mut network::Evaluation) {
    if weight == 0.0 {
        return;
    }
    let standard = Prior::standard(n);
    let (prior, scale) = (prior.unwrap_or(&standard), weight / n as f64);
    let each = vectors.as_chunks::<3>().0.chunks_exact(n).zip(&mut found.losses);
    for ((z, loss), slopes) in each.zip(found.vectors.chunks_exact_mut(3 * n)) {
        let (energy, by) = prior.energy(z);
        *loss += scale * energy;
        for (slope, by) in slopes.iter_mut().zip(by.as_flattened()) {
            *slope += scale * by;
        }
    }
}

/// Watches for the end of improvement, image by image.
struct Stall {
    plateau: Option<Plateau>,
    best: Vec<f64>,
    since: Vec<u64>,
}

impl Stall {
    fn new(plateau: Option<Plateau>, images: usize) -> Self {
        Self { plateau, best: vec![f64::INFINITY; images], since: vec![0; images] }
    }

    /// Whether no image has got better for long enough.
    fn ended(&mut self, losses: &[f64]) -> bool {
        let Some(Plateau { patience, improvement }) = self.plateau else { return false };
        for ((best, since), loss) in self.best.iter_mut().zip(&mut self.since).zip(losses) {
            if best.is_infinite() || *loss < *best - improvement * best.abs() {
                (*best, *since) = (*loss, 0);
            } else {
                *since += 1;
            }
        }
        self.since.iter().all(|since| *since >= patience)
    }
}
