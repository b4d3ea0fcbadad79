//! A light of which only integrals are known: the latent that has them, and is likely otherwise.

use super::config::Method;
use super::network::{ImageLoss, Network};
use super::{FitConfig, FitResult, LatentDecoder, LinearTarget, check_prior, check_starts, optimise};
use crate::{Error, Result};
use veni_light::latent::{Latent, Prior};

/// The prior's weight is a million times what it is in the end at first, and falls to that in these steps. The latents that
/// integrals leave open form a curved valley, along which a weak prior leads only by short steps; a strong one leads near its
/// likely end before there is a valley.
const FALL: [f64; 4] = [1e6, 1e4, 1e2, 1.0];

/// Optimises a latent from each of `start`, to the same target. [`FitConfig::objective`] is not looked at; [`Method::Auto`] is
/// Levenberg–Marquardt where the decoder folds, however many vectors there are: so few residuals leave so many latents that
/// nothing need be explored. What the integrals leave open stays about where it starts; [`likely_linear`] leads it to where the
/// prior is. `observer` gets the number of updates made and the mean loss.
///
/// # Errors
/// [`Error::Invalid`] if nothing is wanted, if sizes disagree, if there is no start, or if the loss is no longer finite.
pub fn fit_linear(
    decoder: &dyn LatentDecoder,
    target: &LinearTarget,
    prior: Option<&Prior>,
    start: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    config.check()?;
    if target.is_empty() {
        return Err(Error::invalid("a target without harmonics and surfaces"));
    }
    let n = decoder.latent_vectors();
    check_starts(start, start.len().max(1), n)?;
    check_prior(prior, n)?;
    let network = Network::new(decoder, target.grid().directions());
    let method = match config.method {
        Method::Auto if network.is_folded() => Method::LevenbergMarquardt,
        method => method,
    };
    let config = FitConfig { method, ..*config };
    optimise(&network, &ImageLoss::Linear(target), prior, start, &config, observer)
}

/// [`fit_linear`] several times on end, [`likely_searches`] of them, under a prior whose weight falls to [`FitConfig::prior`]: of the
/// latents with these integrals a likely one. The weight falls at the coarsest resolution, of 16 rows or a little more; under the
/// last one the search goes on at twice that, and again up to the target's own. Each makes [`FitConfig::steps`] updates at most.
///
/// # Errors
/// As [`fit_linear`].
pub fn likely_linear(
    decoder: &dyn LatentDecoder,
    target: &LinearTarget,
    prior: Option<&Prior>,
    start: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    let mut all = FitResult { latents: start.to_vec(), losses: Vec::new(), last: Vec::new() };
    let levels = target.levels();
    let falling = FALL.into_iter().map(|factor| (factor, &levels[0]));
    for (factor, target) in falling.chain(levels[1..].iter().map(|level| (1.0, level))) {
        let config = FitConfig { prior: factor * config.prior, ..*config };
        let before = all.losses.len() as u64;
        let mut observer = |step, loss| observer(before + step, loss);
        let found = fit_linear(decoder, target, prior, &all.latents, &config, &mut observer)?;
        (all.latents, all.last) = (found.latents, found.last);
        all.losses.extend(found.losses);
    }
    Ok(all)
}

/// How often [`likely_linear`] searches for a target.
pub fn likely_searches(target: &LinearTarget) -> u64 {
    (FALL.len() + target.levels().len() - 1) as u64
}
