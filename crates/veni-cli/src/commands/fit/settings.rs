//! How it is fitted.

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
#[cfg(feature = "learn")]
use veni_fit::loss::LossConfig;
use veni_fit::schedule::LearningRate;
use veni_fit::unseen::{self, PLATEAU};
use veni_fit::{FitConfig, Method, Objective};
use veni_light::sphere::Equirect;

use crate::size::Size;

/// Weight of the prior for the light on a surface.
const LIGHT_PRIOR: f64 = 1e-4;

#[derive(Args, Debug)]
pub(super) struct Settings {
    /// What the following options start from [default: energy with --lobes, and for whole panoramas with models that were trained
    /// without the lights of their panoramas; else thorough]
    #[arg(long, value_enum)]
    preset: Option<Preset>,

    /// What is compared [default: the preset's]
    #[arg(long, value_enum)]
    objective: Option<ObjectiveName>,

    /// How the loss is lowered [default: the preset's; adam where --rate is given]
    #[arg(long, value_enum)]
    method: Option<MethodName>,

    /// Updates per start, at most [default: the preset's]
    #[arg(long, value_name = "K")]
    steps: Option<u64>,

    /// Learning rate of adam, or first and last of an exponential decay [default: the preset's]
    #[arg(long, value_name = "RATE[:LAST]", value_parser = rate)]
    rate: Option<(f64, Option<f64>)>,

    /// Energy weight of the objective energy, the part of the weight that goes by light, 0 to 1: the more, the better
    /// suns and lamps and the worse everything else [default: 0.35 with --lobes and for models that were trained without the lights of their
    /// panoramas, else 0.05]
    #[arg(long, value_name = "PART", alias = "share")]
    energy_weight: Option<f64>,

    /// Weight of the model's prior over latents; 0 turns it off [default: 0.0001, 0.00001 for more than 16 vectors,
    /// 0.01 over the known part of the sphere where there is an unknown one, 0.000001 without a picture; with the presets of the papers 0]
    #[arg(long, value_name = "WEIGHT")]
    prior: Option<f64>,

    /// Whether the exposure is found too [default: free where part of the sphere is unknown; after the fit of a panorama whose lights
    /// are apart, that at which surfaces get its light]
    #[arg(long, value_enum)]
    exposure: Option<Exposure>,

    /// Where the first start is [default: the encoder's latent for whole panoramas, else zero]
    #[arg(long, value_enum)]
    start: Option<Start>,

    /// Number of starts; all but the first are random [default: 1, or 4 where part of the sphere is unknown; without a picture 1]
    #[arg(long, value_name = "K")]
    starts: Option<usize>,

    /// Names the random starts
    #[arg(long, default_value_t = 0, value_name = "S")]
    seed: u64,

    /// Go on to the last step, even when the loss no longer falls
    #[arg(long)]
    no_plateau: bool,

    /// Size at which a panorama is fitted, or light summed [default: 128x64, or 64x32 where part of a picture is unknown]
    #[arg(long, value_name = "W|WxH")]
    resolution: Option<Size>,
}

/// Named settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Preset {
    /// Log radiance, weighted by solid angle, as far down as it goes
    #[default]
    Thorough,
    /// The same, weighted partly (--energy-weight) by the light that comes from there: the sun stands where it belongs, for light
    /// that is to illuminate something
    Energy,
    /// What is seen on a screen under the picture's own white; highlights beyond it are left alone
    Display,
    /// The reference implementation's: 2000 steps from 1e-2 to 2e-3, unweighted, without a prior
    Reference,
    /// RENI++'s evaluation: cosine and scale-invariant error, 2500 steps
    #[cfg(feature = "learn")]
    #[value(name = "reni++")]
    Renipp,
}

impl Preset {
    /// RENI++ has no encoder: its evaluation starts at 0.
    fn starts_at_the_encoder(self) -> bool {
        #[cfg(feature = "learn")]
        return self != Self::Renipp;
        #[cfg(not(feature = "learn"))]
        true
    }
}

/// The objectives by the names that are typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ObjectiveName {
    /// Squared error of log radiance, by solid angle
    Log,
    /// Absolute error of log radiance: a sun that cannot be followed does not drag the rest along
    Absolute,
    /// Squared error of tonemapped values
    Display,
    /// Squared error of log radiance, by solid angle and (--energy-weight) by the light that comes from there
    Energy,
    /// Squared error of log radiance, every pixel alike
    Reference,
    /// RENI++'s: cosine and scale-invariant error
    #[cfg(feature = "learn")]
    CosineScale,
    /// The training losses of the paper: gradients on several scales, scale-invariant error, colour
    #[cfg(feature = "learn")]
    Training,
}

/// The methods by the names that are typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MethodName {
    /// levenberg-marquardt where it applies, after exploring by adam if a latent has more than 16 vectors; else adam
    Auto,
    /// Damped Gauss-Newton steps to the minimum next to the start; for objectives that look at each pixel alone
    LevenbergMarquardt,
    /// As in the papers
    Adam,
}

/// Whether the exposure is a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Exposure {
    /// Found with the latent
    Free,
    /// Such that the picture's mean log luminance is the decoder's
    Fixed,
}

/// The first start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Start {
    /// What the encoder says
    Encoder,
    /// All vectors zero
    Zero,
    /// Drawn from the model's prior
    Noise,
}

impl Settings {
    /// `light`: for the light on a surface, not for a picture of it; `lit`: codes have lights or lobes.
    pub(super) fn config(&self, light: bool, lit: bool) -> Result<FitConfig> {
        let preset = self.preset.unwrap_or(if lit { Preset::Energy } else { Preset::Thorough });
        let energy = if lit { FitConfig::lit() } else { FitConfig::energy() };
        let mut config = match preset {
            Preset::Thorough | Preset::Display | Preset::Energy if light => {
                FitConfig { plateau: Some(PLATEAU), ..FitConfig::light() }
            }
            Preset::Thorough => FitConfig { plateau: Some(PLATEAU), ..FitConfig::thorough() },
            Preset::Display => FitConfig { plateau: Some(PLATEAU), ..FitConfig::display() },
            Preset::Energy => FitConfig { plateau: Some(PLATEAU), ..energy },
            Preset::Reference => FitConfig::reference_helper(1e-2, 2e-3, 2000),
            #[cfg(feature = "learn")]
            Preset::Renipp => FitConfig::reni_evaluation(),
        };
        config = self.descended(config, light)?;
        if let Some(objective) = self.objective {
            config.objective = match objective {
                ObjectiveName::Log => Objective::LogError,
                ObjectiveName::Absolute => Objective::LogAbsolute,
                ObjectiveName::Display => FitConfig::display().objective,
                ObjectiveName::Energy => energy.objective,
                ObjectiveName::Reference => Objective::ReferenceLogError,
                #[cfg(feature = "learn")]
                ObjectiveName::CosineScale => Objective::CosineScaleInvariant,
                #[cfg(feature = "learn")]
                ObjectiveName::Training => Objective::Terms(LossConfig::default()),
            };
        }
        match (self.energy_weight, &mut config.objective) {
            (Some(part), Objective::Energy { weight }) => *weight = part,
            (Some(_), _) => {
                bail!(
                    "--energy-weight: only the objective energy has an energy weight; add --preset energy, or leave it out"
                )
            }
            (None, _) => {}
        }
        if let Some(weight) = self.prior {
            config.prior = weight;
        }
        if self.no_plateau {
            config.plateau = None;
        }
        config.check()?;
        Ok(config)
    }

    /// Which preset it is, for what does not depend on lights.
    fn preset(&self) -> Preset {
        self.preset.unwrap_or_default()
    }

    /// The number of steps, the method and the learning rate.
    fn descended(&self, mut config: FitConfig, light: bool) -> Result<FitConfig> {
        if let Some(steps) = self.steps {
            config = config.in_steps(steps);
        }
        match (self.method, self.rate) {
            (Some(MethodName::LevenbergMarquardt), Some(_)) => bail!(
                "--rate: levenberg-marquardt finds its steps itself; leave --rate out, or take --method adam or auto"
            ),
            (Some(MethodName::LevenbergMarquardt), None) if light => bail!(
                "--method levenberg-marquardt does not apply to the light on a surface; leave it out, or take adam"
            ),
            (Some(MethodName::LevenbergMarquardt), None) => config.method = Method::LevenbergMarquardt,
            (Some(MethodName::Auto), _) => config.method = Method::Auto,
            (Some(MethodName::Adam), _) | (None, Some(_)) => config.method = Method::Adam,
            (None, None) => {}
        }
        if let Some((first, last)) = self.rate {
            config.learning_rate = match (config.learning_rate, last) {
                (LearningRate::Exponential { steps, warm_up, before, ramp, .. }, Some(last)) => {
                    LearningRate::Exponential { rate: first, last, steps, warm_up, before, ramp }
                }
                _ => LearningRate::Constant { rate: first },
            };
        }
        Ok(config)
    }

    /// For integrals of the light, under a decoder that `folds` or does not.
    pub(super) fn for_integrals(&self, folds: bool) -> Result<FitConfig> {
        let plateau = (!self.no_plateau).then_some(PLATEAU);
        let usual = FitConfig { method: Method::LevenbergMarquardt, plateau, ..FitConfig::linear() };
        let slow = FitConfig { method: Method::Adam, ..usual }.in_steps(10 * usual.steps);
        let mut config = self.descended(if folds { usual } else { slow }, false)?;
        config.prior = self.prior.unwrap_or(config.prior);
        config.check()?;
        Ok(config)
    }

    /// What depends on how much of the sphere is known, if not all, and on the latent's number of vectors.
    pub(super) fn adapted(&self, config: FitConfig, known: Option<f32>, vectors: usize) -> FitConfig {
        let prior = match (self.prior, self.preset()) {
            (None, Preset::Thorough | Preset::Display | Preset::Energy) => {
                known.map_or_else(|| FitConfig::prior_for(vectors), unseen::prior_weight)
            }
            _ => config.prior,
        };
        let free_exposure = self.exposure.map_or(known.is_some(), |e| e == Exposure::Free);
        FitConfig { prior, free_exposure, ..config }
    }

    /// For the light on a surface, whose loss is a robust one of log radiance.
    pub(super) fn for_light(&self, config: FitConfig) -> FitConfig {
        let prior = match (self.prior, self.preset()) {
            (None, Preset::Thorough | Preset::Display | Preset::Energy) => LIGHT_PRIOR,
            _ => config.prior,
        };
        let free_exposure = self.exposure.is_none_or(|e| e == Exposure::Free);
        FitConfig { prior, free_exposure, ..config }
    }

    /// The first start, and how many there are.
    pub(super) fn start(&self, whole: bool, has_encoder: bool) -> (Start, usize) {
        let start = match self.start {
            Some(start) => start,
            None if whole && has_encoder && self.preset().starts_at_the_encoder() => Start::Encoder,
            None => Start::Zero,
        };
        let default = if whole { 1 } else { unseen::STARTS };
        (start, self.starts.unwrap_or(default).max(1))
    }

    /// The same without a picture: what it leaves open is left to the prior, not to several starts.
    pub(super) fn start_unseen(&self) -> (Start, usize) {
        (self.start.unwrap_or(Start::Zero), self.starts.unwrap_or(1).max(1))
    }

    /// Whether nothing was said about the exposure.
    pub(super) fn exposure_is_open(&self) -> bool {
        self.exposure.is_none()
    }

    pub(super) fn seed(&self) -> u64 {
        self.seed
    }

    /// Where a panorama is fitted.
    pub(super) fn grid(&self, partial: bool) -> Result<Equirect> {
        Ok(match self.resolution {
            Some(size) => {
                let (width, height) = size.equirect().context("--resolution")?;
                Equirect::new(width, height)
            }
            None if partial => unseen::GRID,
            None => Equirect::new(128, 64),
        })
    }
}

fn rate(text: &str) -> Result<(f64, Option<f64>), String> {
    let number = |t: &str| match t.trim().parse::<f64>() {
        Ok(v) if v.is_finite() && v > 0.0 => Ok(v),
        _ => Err(format!("'{t}' is not a learning rate: give a number above 0, or two as 0.05:0.002")),
    };
    match text.split_once(':') {
        Some((first, last)) => Ok((number(first)?, Some(number(last)?))),
        None => Ok((number(text)?, None)),
    }
}
