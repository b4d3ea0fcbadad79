//! Several starts for one image: the best of them, and how much they disagree.

use super::{
    FitConfig, FitResult, FitTarget, LatentDecoder, LinearTarget, fit_linear, fit_rendered, fit_with,
    likely_linear,
};
use crate::Result;
use crate::shade::RenderedImage;
use veni_light::latent::{Latent, Prior};
use veni_light::random::{Purpose, stream};

/// The best of several fits of one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Best {
    /// The latent with the lowest loss.
    pub latent: Latent,
    /// Its loss.
    pub loss: f64,
    /// The latents of all starts, in their order.
    pub all: Vec<Latent>,
    /// Their losses.
    pub losses: Vec<f64>,
}

/// `count` latents drawn from `prior`, at `log_exposure`. The same seed gives the same starts.
pub fn random_starts(prior: &Prior, log_exposure: f32, count: usize, seed: u64) -> Vec<Latent> {
    let draw = |k: usize| {
        let mut rng = stream(seed, Purpose::Fit, k as u64, 0);
        Latent { log_exposure, ..Latent::new(Latent::sample(prior, &mut rng).vectors) }
    };
    (0..count).map(draw).collect()
}

/// Fits the single image of `target` from every start, and keeps the best. `observer` gets the number of updates
/// made, all starts together, and the loss.
///
/// # Errors
/// As [`fit`](super::fit).
///
/// # Panics
/// If there is no start, or not exactly one image.
pub fn best_of(
    decoder: &dyn LatentDecoder,
    target: &FitTarget<'_>,
    starts: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<Best> {
    assert!(target.count() == 1, "one image");
    from_each(starts, config, observer, |start, observer| {
        fit_with(decoder, target, start, config, None, observer)
    })
}

/// [`best_of`] for the light on a surface: [`fit_rendered`] of one image from every start.
///
/// # Errors
/// As [`fit_rendered`].
///
/// # Panics
/// If there is no start.
pub fn best_light(
    decoder: &dyn LatentDecoder,
    image: &RenderedImage,
    prior: Option<&Prior>,
    starts: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<Best> {
    let image = std::slice::from_ref(image);
    from_each(starts, config, observer, |start, observer| {
        fit_rendered(decoder, image, prior, start, config, observer)
    })
}

/// [`best_of`] for integrals of the light: [`likely_linear`] from the first start, [`fit_linear`] from the others, so that these
/// differ in what the integrals leave open. Losses include the prior.
///
/// # Errors
/// As [`fit_linear`].
///
/// # Panics
/// If there is no start.
pub fn best_linear(
    decoder: &dyn LatentDecoder,
    target: &LinearTarget,
    prior: &Prior,
    starts: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<Best> {
    let (mut first, mut made) = (true, 0);
    // the first start makes more updates than the others
    let mut count = |_, loss| {
        observer(made, loss);
        made += 1;
    };
    from_each(starts, config, &mut count, |start, observer| {
        let fit = if std::mem::take(&mut first) { likely_linear } else { fit_linear };
        let found = fit(decoder, target, Some(prior), start, config, observer)?;
        Ok(with_prior(found, prior, config))
    })
}

/// [`fit_linear`] from latents that are near already, as what [`best_linear`] found for a coarser target. Losses include the prior.
///
/// # Errors
/// As [`fit_linear`].
///
/// # Panics
/// If there is no start.
pub fn refine_linear(
    decoder: &dyn LatentDecoder,
    target: &LinearTarget,
    prior: &Prior,
    starts: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<Best> {
    from_each(starts, config, observer, |start, observer| {
        Ok(with_prior(fit_linear(decoder, target, Some(prior), start, config, observer)?, prior, config))
    })
}

/// The prior's part added to the last losses.
fn with_prior(mut found: FitResult, prior: &Prior, config: &FitConfig) -> FitResult {
    let scale = config.prior / prior.latent_vectors().max(1) as f64;
    for (loss, latent) in found.last.iter_mut().zip(&found.latents) {
        *loss += scale * prior.energy(&latent.vectors).0;
    }
    found
}

/// The best of the fits that `fit` makes from each start; it gets the starts one by one, and a callback as [`fit_with`]'s.
///
/// # Errors
/// Those of `fit`.
///
/// # Panics
/// If there is no start.
pub fn from_each(
    starts: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
    mut fit: impl FnMut(&[Latent], &mut dyn FnMut(u64, f64)) -> Result<FitResult>,
) -> Result<Best> {
    let (mut all, mut losses) = (Vec::new(), Vec::new());
    for (k, start) in starts.iter().enumerate() {
        let before = k as u64 * config.most_updates(start.vectors.len());
        let found = fit(std::slice::from_ref(start), &mut |step, loss| observer(before + step, loss))?;
        all.extend(found.latents);
        losses.extend(found.last);
    }
    Ok(Best::of(all, losses))
}

impl Best {
    /// The best of these latents of one image by their losses.
    ///
    /// # Panics
    /// If there is none, or not one loss for each.
    pub fn of(all: Vec<Latent>, losses: Vec<f64>) -> Self {
        assert!(!all.is_empty() && all.len() == losses.len(), "a loss for each of at least one latent");
        let best = (0..all.len()).min_by(|a, b| losses[*a].total_cmp(&losses[*b])).unwrap_or(0);
        Self { latent: all[best].clone(), loss: losses[best], all, losses }
    }
}
