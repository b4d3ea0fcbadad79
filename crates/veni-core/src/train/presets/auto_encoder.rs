//! VENI in the three sizes.

use crate::train::config::{
    DecoderBackend, DeviceKind, Devices, GroupConfig, LossGrid, Order, ReportConfig, Stored, TrainConfig,
};
use crate::train::loss::LossConfig;
use crate::train::optimiser::AdamConfig;
use veni_data::{AugmentConfig, DataConfig};
use veni_fit::schedule::{LearningRate, WeightSchedule};
use veni_light::model::{DecoderConfig, EncoderConfig, ModelConfig, ModelKind};

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
    }
}

/// Adam with a warmed-up cosine that ends at `floor` times the highest rate.
pub(super) fn group(rate: f64, [warm_up, steps]: [u64; 2], floor: f64, adam: AdamConfig) -> GroupConfig {
    let learning_rate = LearningRate::Cosine { rate, warm_up, steps, floor, periodic: false };
    GroupConfig { learning_rate, adam }
}

/// Weight of the mean divergence per latent vector. Noise in each of many vectors hides what little it holds: measured at 100
/// vectors in docs/DECISIONS.md, Training.
fn divergence_weight(latent_vectors: usize) -> f64 {
    if latent_vectors > 16 { 3e-5 } else { 0.02 }
}

pub(super) fn small(latent_vectors: usize) -> TrainConfig {
    let steps = 12_000;
    let adam = AdamConfig { weight_decay: 0.05, ..AdamConfig::default() };
    TrainConfig {
        seed: 0,
        steps,
        batch: 4,
        accumulate: 1,
        order: Order::Shuffle,
        device: DeviceKind::Flex,
        devices: Devices::default(),
        decoder_backend: DecoderBackend::Kernels,
        ema_decay: 0.999,
        model: ModelConfig {
            kind: ModelKind::Veni,
            lights: 1,
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
        // The gradient term is lighter than the paper's: a latent of dimension 27 cannot follow edges. What a viewer sees
        // (clamped, tonemapped) is asked for directly, which covers most of the colour too; and what lights a surface,
        // since the mean of a logarithm loses the energy of what is small and bright.
        loss: LossConfig {
            mage: WeightSchedule::Constant(0.1),
            cosine: WeightSchedule::Constant(0.1),
            kld: WeightSchedule::Constant(divergence_weight(latent_vectors)),
            ldr_mse: WeightSchedule::Constant(15.0),
            irradiance: WeightSchedule::Constant(2.0),
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

pub(super) fn tiny(latent_vectors: usize) -> TrainConfig {
    let steps = 200;
    let small = small(latent_vectors);
    TrainConfig {
        steps,
        batch: 2,
        ema_decay: 0.9,
        model: ModelConfig {
            kind: ModelKind::Veni,
            lights: 0,
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
        loss_grid: LossGrid::Full {},
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
        // the suns are in what it sees, and no few updates learn their energy
        loss: LossConfig { irradiance: WeightSchedule::Constant(0.0), ..small.loss },
        ..small
    }
}

pub(super) fn paper(latent_vectors: usize) -> TrainConfig {
    let steps = 40_001;
    TrainConfig {
        seed: 42,
        steps,
        batch: 5,
        order: Order::Replacement,
        ema_decay: 0.0,
        model: ModelConfig {
            kind: ModelKind::Veni,
            lights: 0,
            latent_vectors,
            decoder: DecoderConfig::default(),
            encoder: Some(EncoderConfig::default()),
        },
        augment: AugmentConfig { mirror: 0.5, ..AugmentConfig::default() },
        loss_grid: LossGrid::Full {},
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
