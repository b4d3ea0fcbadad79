//! RENI++ in the three sizes.

use super::Preset;
use super::auto_encoder::group;
use crate::fit::{FitConfig, Method};
use crate::train::config::{LossGrid, Order, ReportConfig, TrainConfig};
use crate::train::latents::LatentsConfig;
use crate::train::loss::LossConfig;
use crate::train::optimiser::AdamConfig;
use veni_data::AugmentConfig;
use veni_fit::schedule::{LearningRate, Ramp, WeightSchedule};
use veni_light::model::{ModelConfig, ModelKind};

pub(super) fn preset(size: Preset, latent_vectors: usize) -> TrainConfig {
    let veni = size.config(latent_vectors);
    let (steps, warm_up, batch, rays) = match size {
        Preset::Tiny => (200, 10, 2, 128),
        Preset::Small => (12_000, 200, 8, 4096),
        Preset::Paper => (50_001, 500, 16, 8192),
    };
    let (fit, factor) = if size == Preset::Tiny { (20, 1) } else { (150, 4) };
    let falling = |steps| LearningRate::Exponential {
        rate: 5e-2,
        last: 2e-3,
        steps,
        warm_up: 0,
        before: 0.0,
        ramp: Ramp::Cosine,
    };
    let fit = FitConfig {
        steps: fit,
        method: Method::Adam,
        learning_rate: falling(fit),
        prior: 1e-3,
        ..FitConfig::thorough()
    };
    let off = WeightSchedule::Constant(0.0);
    let adam = AdamConfig { epsilon: 1e-15, clip: None, ..AdamConfig::default() };
    let group = || group(1e-3, [warm_up, steps], 0.05, adam);
    TrainConfig {
        steps,
        batch,
        order: Order::Replacement,
        ema_decay: 0.0,
        model: ModelConfig { kind: ModelKind::Reni, lights: 0, encoder: None, ..veni.model },
        augment: AugmentConfig::default(),
        loss_grid: LossGrid::Full {},
        loss: LossConfig { mage: off, kld: WeightSchedule::Constant(1e-6), ..LossConfig::reference() },
        decoder: group(),
        encoder: None,
        latents: Some(LatentsConfig {
            optimiser: group(),
            rays,
            free_exposure: false,
            validation: fit,
            validation_panoramas: 8,
            validation_factor: factor,
        }),
        report: ReportConfig {
            validate_every: if size == Preset::Tiny { 50 } else { steps / 10 },
            prior_copies: 0,
            ..veni.report
        },
        ..veni
    }
}
