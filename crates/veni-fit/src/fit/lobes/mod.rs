//! Lobes for what the vectors of a code leave: placed one after the other on the residual, then fitted with the vectors.
//! MODEL (82), MODEL (83).
//!
//! A code of N vectors and K lobes is searched in rounds. In each some lobes are placed by matching pursuit
//! ([`pursuit`]), then Levenberg–Marquardt moves everything at once: vectors, amplitudes, sharpnesses and directions.

mod pursuit;

use super::config::FitConfig;
use super::decoder::LatentDecoder;
use super::descent::Penalty;
use super::levenberg_marquardt::{QuadraticModel, Search};
use super::network::local_quadratic;
use super::pixel::PixelLoss;
use super::target::FitTarget;
use super::{check_prior, check_starts};
use crate::{Error, Result};
use pursuit::Pursuit;
use veni_light::field::{Decoder, LocalQuadratic, NormalEquations};
use veni_light::latent::{Latent, Prior};
use veni_light::limits;

/// Weight of |a|² of a lobe's amplitude beside the mean squared error of log radiance: two lobes on one another share what they
/// explain, instead of cancelling each other.
const SMALL: f64 = 1e-5;
/// The widest lobe, about a constant over the sphere.
const BLUNT: f32 = 0.05;
/// Lobes are placed in this many rounds, as many in each.
const ROUNDS: usize = 8;
/// Updates of a round, at most, but for the last.
const BETWEEN: u64 = 5;

/// The widest light of a code with lobes, an angular radius in radians: a wider glow is left to lobes, which follow its shape. As a
/// light it would cover what is before it.
pub const WIDEST_LIGHT: f32 = 1.5 * std::f32::consts::PI / 180.0;

/// The lobes that a fit adds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LobePlan {
    /// K, the number of lobes that are added to each latent.
    pub count: usize,
    /// Whether the vectors, and the exposure where the configuration frees it, stay as they are. Else all are fitted together.
    pub only_lobes: bool,
}

/// Adds lobes to each latent and fits them; the lobes that a latent has already are fitted too. Gives each latent with its loss,
/// as [`FitResult::last`](super::FitResult::last) has it.
///
/// `latents` are those that [`fit`](super::fit) found for the images of `target`, or an encoder's; `observer` gets the number of
/// updates made, all images together, and the loss, prior included.
///
/// # Errors
/// As [`fit`](super::fit); [`Error::Unsupported`] for a decoder that does not fold and for objectives that look at whole images;
/// [`Error::TooLarge`] for more lobes than a latent may have.
pub fn fit_lobes(
    decoder: &dyn LatentDecoder,
    target: &FitTarget<'_>,
    latents: &[Latent],
    plan: LobePlan,
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<Vec<(Latent, f64)>> {
    config.check()?;
    target.check_finite()?;
    let n = decoder.latent_vectors();
    check_starts(latents, target.count(), n)?;
    check_prior(target.prior(), n)?;
    let decoder = decoder.folded().ok_or_else(|| {
        Error::unsupported("lobes are fitted under a decoder that folds per latent, which this one does not")
    })?;
    if !config.objective.is_pixelwise() {
        return Err(Error::unsupported(
            "lobes are fitted under objectives that look at each pixel alone, log-error for instance",
        ));
    }
    let most = latents.iter().map(|z| z.lobes.len()).max().unwrap_or(0) + plan.count;
    if most > limits::MAX_LOBES {
        let text = format!("{most} lobes, at most {} are taken", limits::MAX_LOBES);
        return Err(Error::beyond(text, most as u64, limits::MAX_LOBES as u64));
    }
    let standard = Prior::standard(n);
    let penalty = Penalty::new(target.prior().unwrap_or(&standard), config);
    let directions = target.directions();
    let sharpness = [BLUNT, target.sharpest().max(2.0 * BLUNT)];
    let shared = Shared {
        decoder,
        pursuit: (plan.count > 0).then(|| Pursuit::new(&directions, sharpness)),
        directions,
        hessian: penalty.hessian(),
        penalty,
        sharpness,
        plan,
        config,
    };
    let losses = PixelLoss::of_images(config.objective, target);
    let mut made = 0;
    let mut count = |loss| {
        observer(made, loss);
        made += 1;
    };
    let fit = |(z, loss)| Image::new(&shared, loss, z)?.fit(z, &mut count);
    latents.iter().zip(&losses).map(fit).collect()
}

/// What the fits of all images share.
struct Shared<'a> {
    decoder: &'a Decoder,
    pursuit: Option<Pursuit>,
    directions: Vec<[f32; 3]>,
    penalty: Penalty<'a>,
    /// Of the penalty.
    hessian: Vec<f64>,
    /// The least and the largest of a lobe.
    sharpness: [f32; 2],
    plan: LobePlan,
    config: &'a FitConfig,
}

/// One image under the decoder.
struct Image<'a> {
    shared: &'a Shared<'a>,
    loss: &'a PixelLoss<'a>,
    /// The log radiance to which lobes are added, where they alone move.
    base: Option<Vec<[f32; 3]>>,
}

impl<'a> Image<'a> {
    fn new(shared: &'a Shared<'a>, loss: &'a PixelLoss<'a>, start: &Latent) -> Result<Self> {
        let without = || shared.log_radiance(&Latent { lobes: Vec::new(), ..start.clone() });
        let base = shared.plan.only_lobes.then(without).transpose()?;
        Ok(Self { shared, loss, base })
    }

    fn fit(&self, start: &Latent, observer: &mut dyn FnMut(f64)) -> Result<(Latent, f64)> {
        let Shared { plan: LobePlan { count, .. }, config: FitConfig { steps, .. }, .. } = *self.shared;
        let mut latent = start.clone();
        let mut placed = 0;
        for round in 1..=ROUNDS {
            let more = count * round / ROUNDS - placed;
            if let (Some(pursuit), 1..) = (&self.shared.pursuit, more) {
                let found = pursuit.place(&self.local(&latent)?, more);
                latent.lobes.extend(found);
                placed += more;
            } else if round < ROUNDS {
                continue;
            }
            let steps = if round == ROUNDS { *steps } else { BETWEEN.min(*steps) };
            latent = self.descend(latent, steps, observer)?;
        }
        let loss = self.local(&latent)?.iter().map(|local| local.loss).sum();
        Ok((latent, loss))
    }

    /// Levenberg–Marquardt on everything that moves.
    fn descend(&self, latent: Latent, steps: u64, observer: &mut dyn FnMut(f64)) -> Result<Latent> {
        let model = self.model(&latent)?;
        let mut search = Search::new(latent, model).with_sharpness(self.shared.sharpness);
        for _ in 0..steps {
            observer(search.value());
            if search.ended() {
                break;
            }
            search.step(|latent| self.model(latent))?;
        }
        Ok(search.into_latent())
    }

    fn model(&self, latent: &Latent) -> Result<QuadraticModel> {
        let Shared { decoder, directions, penalty, hessian, config, .. } = self.shared;
        let loss = |i, p| local_quadratic(self.loss, i, p);
        let moving = if let Some(base) = &self.base {
            QuadraticModel::of_lobes(NormalEquations::of_lobes(&latent.lobes, base, directions, loss))
        } else {
            let found = decoder.condition(latent)?.normal_equations_with_lobes(directions, loss);
            let (value, by) = penalty.at(&latent.vectors);
            QuadraticModel::new(found, latent.vectors.len(), config.free_exposure).plus(value, &by, hessian)
        };
        Ok(moving.with_small_lobes(latent, SMALL))
    }

    /// What each pixel says at the latent.
    fn local(&self, latent: &Latent) -> Result<Vec<LocalQuadratic>> {
        let prediction = self.shared.log_radiance(latent)?;
        Ok(prediction.into_iter().enumerate().map(|(i, p)| local_quadratic(self.loss, i, p)).collect())
    }
}

impl Shared<'_> {
    fn log_radiance(&self, latent: &Latent) -> Result<Vec<[f32; 3]>> {
        let mut values = vec![[0.0; 3]; self.directions.len()];
        self.decoder.condition(latent)?.log_radiance_batch(&self.directions, &mut values);
        Ok(values)
    }
}

impl FitTarget<'_> {
    /// The sharpness of a lobe whose half width at 1/e is a pixel: a sharper one would not be seen.
    fn sharpest(&self) -> f32 {
        let spacing = self.spacing();
        2.0 / (spacing * spacing)
    }
}
