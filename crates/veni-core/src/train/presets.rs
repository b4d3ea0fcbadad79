//! Named starting points: `tiny` for tests, `small` for two cores, `paper` for a graphics card.

use std::path::PathBuf;

use toml::{Table, Value};

use crate::data::{AugmentConfig, DataConfig};
use crate::fit::{FitConfig, Method};
use crate::model::{DecoderConfig, EncoderConfig, ModelConfig, ModelKind};
use crate::train::config::{
    DecoderBy, DeviceKind, GroupConfig, LossGrid, Order, ReportConfig, StageConfig, Stored, TrainConfig,
};
use crate::train::latents::LatentsConfig;
use crate::train::loss::LossConfig;
use crate::train::optimiser::AdamConfig;
use crate::train::schedule::{LearningRate, Ramp, WeightSchedule};
use crate::{Error, Result};

/// A named configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// A model that trains a step in milliseconds: for tests and to see the machinery work.
    Tiny,
    /// As good as an hour on two cores can buy.
    Small,
    /// The paper's sizes and the authors' optimisation (REFERENCE numbers throughout).
    Paper,
}

impl std::str::FromStr for Preset {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "tiny" => Ok(Self::Tiny),
            "small" => Ok(Self::Small),
            "paper" => Ok(Self::Paper),
            _ => Err(Error::invalid(format!("preset {name} is unknown: tiny, small or paper"))),
        }
    }
}

impl Preset {
    /// The auto-encoder VENI for N latent vectors, without data folders.
    pub fn config(self, latent_vectors: usize) -> TrainConfig {
        match self {
            Self::Tiny => tiny(latent_vectors),
            Self::Small => small(latent_vectors),
            Self::Paper => paper(latent_vectors),
        }
    }

    /// The auto-decoder RENI++ for N latent vectors, with the decoder of [`config`](Self::config) and without data
    /// folders. Losses, rates and rays are the authors'; only steps, rays and their validation depend on the preset.
    pub fn auto_decoder(self, latent_vectors: usize) -> TrainConfig {
        let veni = self.config(latent_vectors);
        let (steps, warm_up, batch, rays) = match self {
            Self::Tiny => (200, 10, 2, 128),
            Self::Small => (12_000, 200, 8, 4096),
            Self::Paper => (50_001, 500, 16, 8192),
        };
        let (fit, factor) = if self == Self::Tiny { (20, 1) } else { (150, 4) };
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
            model: ModelConfig { kind: ModelKind::Reni, encoder: None, ..veni.model },
            augment: AugmentConfig::default(),
            loss_grid: LossGrid::Full,
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
                validate_every: if self == Self::Tiny { 50 } else { steps / 10 },
                prior_copies: 0,
                ..veni.report
            },
            ..veni
        }
    }
}

/// How much lower the learning rates of fine-tuning are: the authors' (1e-5 and 1e-4 after 1e-4 and 1e-3).
const FINE: f64 = 10.0;

impl TrainConfig {
    /// The same run behind a stage `pretrain` of `steps` updates on other panoramas and so many generated scenes; its own
    /// updates become the stage `finetune`, with a tenth of the learning rates.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it has stages already, or is an auto-decoder's.
    pub fn pretrained_on(mut self, folders: &[PathBuf], synthetic: usize, steps: u64) -> Result<Self> {
        if let Some(first) = self.stage.first() {
            return Err(Error::invalid(format!("the run has a stage {} already", first.name)));
        }
        let folders = folders.iter().map(|folder| Value::String(folder.display().to_string())).collect();
        let data = Table::from_iter([
            ("folders".to_owned(), Value::Array(folders)),
            ("synthetic".to_owned(), Value::Integer(synthetic as i64)),
        ]);
        let pretrain = Table::from_iter([("data".to_owned(), Value::Table(data))]);
        let finetune = self.groups().into_iter().map(|(name, group)| (name.to_owned(), lowered(group)));
        let (own, finetune) = (self.steps, finetune.collect());
        self.set_steps(steps + own);
        self.stage = vec![
            StageConfig { name: "pretrain".to_owned(), steps, changes: pretrain },
            StageConfig { name: "finetune".to_owned(), steps: own, changes: finetune },
        ];
        self.check().map(|()| self)
    }
}

/// The change of a group that lowers its learning rate: `{learning_rate = {rate = …}}`.
fn lowered(group: &GroupConfig) -> Value {
    let rates = match group.learning_rate {
        LearningRate::Constant { rate } | LearningRate::Cosine { rate, .. } => vec![("rate", rate)],
        LearningRate::Exponential { rate, last, .. } => vec![("rate", rate), ("last", last)],
    };
    let rates = rates.into_iter().map(|(name, rate)| (name.to_owned(), Value::Float(rate / FINE)));
    Value::Table(Table::from_iter([("learning_rate".to_owned(), Value::Table(rates.collect()))]))
}

/// Augmentation that keeps a sky a sky; chosen for a training set of some dozens.
fn varied() -> AugmentConfig {
    AugmentConfig {
        turn: 1.0,
        mirror: 0.5,
        exposure: 0.1,
        white_balance: 0.1,
        contrast: 0.15,
        polar_warp: 0.4,
        recombine: 0.4,
        recombine_blend: 4.0,
        azimuth_warp: 0.5,
        join: 0.3,
        join_blend: 0.5,
        mix: 0.3,
        mix_share: 0.5,
        lobes: 0.0,
        sun: 0.0,
    }
}

/// Adam with a warmed-up cosine that ends at `floor` times the highest rate.
fn group(rate: f64, [warm_up, steps]: [u64; 2], floor: f64, adam: AdamConfig) -> GroupConfig {
    let learning_rate = LearningRate::Cosine { rate, warm_up, steps, floor, periodic: false };
    GroupConfig { learning_rate, adam }
}

/// Weight of the mean divergence per latent vector. Noise in each of many vectors hides what little it holds: measured at 100
/// vectors in docs/DECISIONS.md, Training.
fn divergence_weight(latent_vectors: usize) -> f64 {
    if latent_vectors > 16 { 3e-5 } else { 0.02 }
}

fn small(latent_vectors: usize) -> TrainConfig {
    let steps = 12_000;
    let adam = AdamConfig { weight_decay: 0.05, ..AdamConfig::default() };
    TrainConfig {
        seed: 0,
        steps,
        batch: 4,
        accumulate: 1,
        order: Order::Shuffle,
        device: DeviceKind::Flex,
        decoder_by: DecoderBy::Kernels,
        ema_decay: 0.999,
        model: ModelConfig {
            kind: ModelKind::Veni,
            latent_vectors,
            decoder: DecoderConfig::default(),
            encoder: Some(EncoderConfig {
                stripes: 64,
                samples: Some(128),
                channels: 96,
                depth: 4,
                heads: 6,
                head_channels: 16,
                ..EncoderConfig::default()
            }),
        },
        data: DataConfig::default(),
        augment: varied(),
        loss_grid: LossGrid::Strided { factor: 2 },
        // The gradient term is lighter than the paper's: 27 numbers cannot follow edges. What a viewer sees
        // (clamped, tonemapped) is asked for directly, which covers most of the colour too.
        loss: LossConfig {
            mage: WeightSchedule::Constant(0.1),
            cosine: WeightSchedule::Constant(0.1),
            kld: WeightSchedule::Constant(divergence_weight(latent_vectors)),
            ldr_mse: WeightSchedule::Constant(15.0),
            ..LossConfig::default()
        },
        decoder: group(1e-3, [200, steps], 0.01, AdamConfig { weight_decay: 0.01, ..adam }),
        encoder: Some(group(1e-3, [200, steps], 0.01, adam)),
        latents: None,
        report: ReportConfig {
            validate_every: 500,
            preview_every: 1000,
            checkpoint_every: 500,
            train_subset: 8,
            prior_copies: 4,
            stored: Stored::F16,
        },
        init: None,
        stage: Vec::new(),
    }
}

fn tiny(latent_vectors: usize) -> TrainConfig {
    let steps = 200;
    TrainConfig {
        steps,
        batch: 2,
        ema_decay: 0.9,
        model: ModelConfig {
            kind: ModelKind::Veni,
            latent_vectors,
            decoder: DecoderConfig { hidden: 16, layers: 2, heads: 4, ..DecoderConfig::default() },
            encoder: Some(EncoderConfig {
                stripes: 16,
                samples: Some(32),
                channels: 16,
                depth: 2,
                heads: 2,
                head_channels: 8,
                ..EncoderConfig::default()
            }),
        },
        data: DataConfig { width: 32, height: 16, ..DataConfig::default() },
        loss_grid: LossGrid::Full,
        decoder: group(3e-3, [10, steps], 0.05, AdamConfig::default()),
        encoder: Some(group(3e-3, [10, steps], 0.05, AdamConfig::default())),
        report: ReportConfig {
            validate_every: 50,
            preview_every: 100,
            checkpoint_every: 50,
            train_subset: 4,
            prior_copies: 1,
            stored: Stored::F16,
        },
        ..small(latent_vectors)
    }
}

fn paper(latent_vectors: usize) -> TrainConfig {
    let steps = 40_001;
    TrainConfig {
        seed: 42,
        steps,
        batch: 5,
        order: Order::Replacement,
        ema_decay: 0.0,
        model: ModelConfig {
            kind: ModelKind::Veni,
            latent_vectors,
            decoder: DecoderConfig::default(),
            encoder: Some(EncoderConfig::default()),
        },
        augment: AugmentConfig { mirror: 0.5, ..AugmentConfig::default() },
        loss_grid: LossGrid::Full,
        loss: LossConfig::default(),
        decoder: group(1e-4, [200, steps], 0.05, AdamConfig::default()),
        encoder: Some(group(1e-3, [200, steps], 0.05, AdamConfig::default())),
        report: ReportConfig {
            validate_every: 1000,
            preview_every: 1000,
            checkpoint_every: 1000,
            train_subset: 16,
            prior_copies: 4,
            stored: Stored::F16,
        },
        ..small(latent_vectors)
    }
}
