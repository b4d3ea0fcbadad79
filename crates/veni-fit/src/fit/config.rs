//! What is minimised, and how. MODEL (37).

use serde::{Deserialize, Serialize};

use crate::loss::LossConfig;
use crate::schedule::{LearningRate, Ramp};
use crate::{Error, Result};

/// What is minimised, and how.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitConfig {
    /// Updates, at most; see [`Method`] for what follows them.
    pub steps: u64,
    /// How the loss is lowered.
    #[serde(default, skip_serializing_if = "Method::is_adam")]
    pub method: Method,
    /// Learning rate of Adam over the updates, from step 0.
    pub learning_rate: LearningRate,
    /// Adam's ε. The reference implementation's 1e-15 makes every coordinate move by the full rate at first.
    pub epsilon: f64,
    /// What is compared.
    pub objective: Objective,
    /// Weight of −ln p of the latent, divided by N, p being [`FitTarget::with_prior`](super::FitTarget::with_prior) (½ mean
    /// |z|² where none is given); 0: off.
    pub prior: f64,
    /// Whether each latent's log exposure is optimised too.
    pub free_exposure: bool,
    /// When Adam stops before `steps`; absent: never.
    #[serde(default)]
    pub plateau: Option<Plateau>,
}

/// How the loss is lowered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Adam with β = (0.9, 0.999): the reference's. For every decoder and objective.
    #[default]
    Adam,
    /// Gauss–Newton steps with a damping that adapts itself: no learning rate, and it ends by itself where the loss no
    /// longer falls, at the minimum next to the start. For folded decoders
    /// ([`LatentDecoder::folded`](super::LatentDecoder::folded)) and objectives that look at each pixel alone.
    LevenbergMarquardt,
    /// Levenberg–Marquardt where it applies, else Adam. With more than 16 latent vectors the loss has so many minima that
    /// the one next to the start is seldom a good one: there Adam explores for all the updates, and
    /// Levenberg–Marquardt goes to the end from where it stops, in 60 more at most.
    Auto,
}

/// [`Objective::Energy`]'s weight by default: docs/results/light.md, "The energy weight of a fit".
const ENERGY_WEIGHT: f64 = 0.05;
/// The same where the sun is a light of the code: docs/results/light.md, "Lobes in a code".
const LIT_WEIGHT: f64 = 0.35;
/// Weight of the prior beside integrals of light: it decides what they leave open, and gives way where they do not.
const LINEAR_PRIOR: f64 = 1e-6;
/// Most latent vectors of a small code, which [`Method::Auto`] fits without exploring.
const FEW: usize = 16;
/// Updates of Levenberg–Marquardt after exploring.
const POLISH: u64 = 60;

impl Method {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
    fn is_adam(&self) -> bool {
        *self == Self::Adam
    }
}

/// Stops a fit by Adam that no longer gets better.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plateau {
    /// The number of updates without an improvement that ends the fit.
    pub patience: u64,
    /// A loss counts as better if it is below the best so far by this fraction of it.
    pub improvement: f64,
}

/// The part of the loss that looks at the image. P is the prediction, I the image, both log radiance; ω is a
/// pixel's area (solid angle), m its mask.
///
/// The first five look at each pixel alone: then a step costs one pass forward and one backward, fused. The
/// others need the whole image before they know any pixel's gradient: one more pass forward.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[expect(clippy::large_enum_variant, reason = "there is one per fit, and it stays plain data")]
pub enum Objective {
    /// Σ ω m (P − I)²/Σ ω m.
    LogError,
    /// Σ ω m (√((P − I)² + δ²) − δ)/Σ ω m with δ = 0.1: like |P − I|, so that a sun or a lamp that the decoder
    /// cannot follow does not drag the rest along.
    LogAbsolute,
    /// Σ ω m (D(P) − D(I))²/Σ ω m + `log` · [`Objective::LogError`], D(x) = the sRGB curve of
    /// min(eˣ/white, 1), white = the 98 % quantile of the image: errors as a screen shows them. (The LDR
    /// scores give the prediction a white of its own; this does not optimise them.)
    Display {
        /// Weight of the log error, which keeps what the display clips in place.
        log: f64,
    },
    /// (1 − `weight`) · [`Objective::LogError`] + `weight` · Σ ω m (L/L̄) ρ(P − I)/Σ ω m, L being a pixel's luminance, L̄ its
    /// mean over ω m, and ρ(e) = 2 (√(1 + e²) − 1): a pixel counts by its area and a little by the light that comes from
    /// it, where ρ (e² for small e, a line for large ones) keeps a sun that the decoder cannot follow from dragging the
    /// rest along. For light that is to illuminate something: a sun is a thousandth of the sphere and half of its light.
    Energy {
        /// Energy weight: the part of the weight that goes by light, in [0, 1].
        #[serde(alias = "share")]
        weight: f64,
    },
    /// mean((m P − m I)²) over all pixels alike: the reference's helper.
    ReferenceLogError,
    /// 1 − mean cos(P, I) + mean(R²) − mean(R)², R = P − I, over all pixels of all images alike (RENI++);
    /// with a free exposure, + mean(R²). It takes no mask.
    CosineScaleInvariant,
    /// Any mixture of the training losses, on a whole panorama without masks.
    Terms(LossConfig),
}

impl Objective {
    /// Whether it is a sum over pixels that looks at each alone.
    pub fn is_pixelwise(&self) -> bool {
        !matches!(self, Self::CosineScaleInvariant | Self::Terms(_))
    }
}

impl FitConfig {
    /// From any start to convergence with solid-angle weights: for evaluation, where systems are compared under one
    /// objective.
    pub fn thorough() -> Self {
        Self {
            steps: 400,
            method: Method::Auto,
            learning_rate: exponential(2e-1, 2e-3, 400),
            epsilon: 1e-8,
            objective: Objective::LogError,
            prior: 1e-4,
            free_exposure: false,
            plateau: None,
        }
    }

    /// The weight of the prior for a whole panorama: 1e-4, and 1e-5 for more than 16 vectors, whose prior, the Gaussian of a
    /// few thousand training codes, is narrow in directions that other panoramas need (docs/DECISIONS.md, Fitting).
    pub fn prior_for(vectors: usize) -> f64 {
        if vectors > FEW { 1e-5 } else { 1e-4 }
    }

    /// As [`FitConfig::thorough`], for what a screen shows under the image's own white.
    pub fn display() -> Self {
        Self { objective: Objective::Display { log: 0.01 }, ..Self::thorough() }
    }

    /// As [`FitConfig::thorough`], with an eye to where the light comes from: for use.
    pub fn energy() -> Self {
        Self { objective: Objective::Energy { weight: ENERGY_WEIGHT }, ..Self::thorough() }
    }

    /// As [`FitConfig::energy`] for codes with lights or lobes: with the sun taken out, the light that is left weighs more.
    pub fn lit() -> Self {
        Self { objective: Objective::Energy { weight: LIT_WEIGHT }, ..Self::thorough() }
    }

    /// For the light on a surface ([`fit_rendered`](super::fit_rendered)), whose loss is not a sum over the light's pixels.
    pub fn light() -> Self {
        Self { method: Method::Adam, learning_rate: exponential(5e-2, 2e-3, 400), ..Self::thorough() }
    }

    /// For integrals of light ([`fit_linear`](super::fit_linear)), exposure included, by Levenberg–Marquardt; Adam needs ten
    /// times the steps.
    pub fn linear() -> Self {
        Self { prior: LINEAR_PRIOR, free_exposure: true, ..Self::thorough() }.in_steps(40)
    }

    /// The reference implementation's helper (figures, uniqueness): `steps` steps from `rate` to `last`.
    pub fn reference_helper(rate: f64, last: f64, steps: u64) -> Self {
        Self {
            steps,
            method: Method::Adam,
            learning_rate: exponential(rate, last, steps),
            epsilon: 1e-15,
            objective: Objective::ReferenceLogError,
            prior: 0.0,
            free_exposure: false,
            plateau: None,
        }
    }

    /// RENI++'s evaluation: 2500 steps from latent 0, without random rays.
    pub fn reni_evaluation() -> Self {
        Self {
            steps: 2500,
            method: Method::Adam,
            learning_rate: exponential(1e-1, 1e-7, 2500),
            epsilon: 1e-15,
            objective: Objective::CosineScaleInvariant,
            prior: 0.0,
            free_exposure: false,
            plateau: None,
        }
    }

    /// The same fit in another number of steps: rates that fell until the old last step fall until the new one.
    #[must_use]
    pub fn in_steps(self, steps: u64) -> Self {
        let mut learning_rate = self.learning_rate;
        match &mut learning_rate {
            LearningRate::Cosine { steps: end, .. } | LearningRate::Exponential { steps: end, .. }
                if *end == self.steps =>
            {
                *end = steps;
            }
            _ => {}
        }
        Self { steps, learning_rate, ..self }
    }

    /// Updates of Adam and then of Levenberg–Marquardt, at most, for latents of `vectors` vectors; `applies` says whether
    /// the latter applies.
    pub(super) fn plan(&self, vectors: usize, applies: bool) -> [u64; 2] {
        match self.method {
            Method::Auto if applies && vectors > FEW => [self.steps, POLISH],
            Method::Auto if !applies => [self.steps, 0],
            Method::Adam => [self.steps, 0],
            Method::LevenbergMarquardt | Method::Auto => [0, self.steps],
        }
    }

    /// Updates for latents of `vectors` vectors, at most.
    pub fn most_updates(&self, vectors: usize) -> u64 {
        self.plan(vectors, true).iter().sum()
    }

    /// Checks what types cannot.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the setting, its value and what is allowed.
    pub fn check(&self) -> Result<()> {
        let mut numbers = vec![("prior", self.prior, true), ("epsilon", self.epsilon, false)];
        for step in [0, self.steps / 2, self.steps] {
            numbers.push(("learning_rate", self.learning_rate.at(step), true));
        }
        if let Some(plateau) = self.plateau {
            numbers.push(("plateau.improvement", plateau.improvement, true));
        }
        if let Objective::Energy { weight } = self.objective
            && !(0.0..=1.0).contains(&weight)
        {
            return Err(Error::invalid(format!("objective.energy.weight = {weight}: must lie in 0..=1")));
        }
        if let Objective::Display { log } = self.objective {
            numbers.push(("objective.display.log", log, true));
        }
        for (name, value, zero) in numbers {
            if !(value.is_finite() && (value > 0.0 || zero && value == 0.0)) {
                let least = if zero { "at least 0" } else { "above 0" };
                return Err(Error::invalid(format!("{name} = {value}: must be finite and {least}")));
            }
        }
        Ok(())
    }
}

fn exponential(rate: f64, last: f64, steps: u64) -> LearningRate {
    LearningRate::Exponential { rate, last, steps, warm_up: 0, before: 0.0, ramp: Ramp::Cosine }
}
