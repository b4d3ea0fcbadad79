//! Everything that defines a training run, as stored in its `config.toml`.

mod bounds;
mod check;
mod device;
mod loss_grid;
mod overrides;
mod report;
mod size;
mod stage;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

pub use device::{DecoderBackend, DeviceKind, Devices, WorkingDevice};
pub use loss_grid::LossGrid;
pub use report::{ReportConfig, Stored};
pub use stage::{Stage, StageConfig};

use crate::train::init::InitConfig;
use crate::train::latents::LatentsConfig;
use crate::train::loss::LossConfig;
use crate::train::optimiser::AdamConfig;
use crate::{Error, Result};
use veni_data::{AugmentConfig, DataConfig};
use veni_fit::schedule::LearningRate;
use veni_light::model::ModelConfig;

/// A training run. Which system is trained is said by `model.kind`: the auto-encoder VENI, or the auto-decoder
/// RENI++.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Seed of everything random.
    pub seed: u64,
    /// Number of updates; with stages, of all of them together.
    pub steps: u64,
    /// Panoramas per step.
    pub batch: usize,
    /// Parts that a batch is computed in on each device, one after the other, with their gradients averaged: the same
    /// step up to rounding, in the memory of `batch / accumulate` panoramas.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub accumulate: usize,
    /// How a batch is drawn.
    pub order: Order,
    /// Where gradients are computed.
    pub device: DeviceKind,
    /// Which of these devices, by number: each computes a part of every batch at the same time as the others. On a
    /// processor every number is a share of its threads.
    #[serde(default, skip_serializing_if = "is_first")]
    pub devices: Devices,
    /// The decoder backend. A file that does not say it means what is best on its device
    /// ([`DeviceKind::decoder_backend`]).
    #[serde(default, alias = "decoder_by")]
    pub decoder_backend: DecoderBackend,
    /// Decay of the averaged weights, which are validated and become the model; 0 takes the last weights.
    pub ema_decay: f64,
    /// The network.
    pub model: ModelConfig,
    /// The panoramas.
    pub data: DataConfig,
    /// Augmentation of training panoramas.
    pub augment: AugmentConfig,
    /// Which directions a step computes the losses on.
    pub loss_grid: LossGrid,
    /// Loss parts and their weights.
    pub loss: LossConfig,
    /// Optimiser of the decoder.
    pub decoder: GroupConfig,
    /// Optimiser of the encoder; absent with an auto-decoder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder: Option<GroupConfig>,
    /// The latent table of an auto-decoder; absent with an auto-encoder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latents: Option<LatentsConfig>,
    /// Validation, previews, checkpoints.
    pub report: ReportConfig,
    /// The model that the run begins with; absent: weights from the seed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub init: Option<InitConfig>,
    /// Parts of the run with settings of their own; none: the run is one part.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stage: Vec<StageConfig>,
}

fn one() -> usize {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_one(n: &usize) -> bool {
    *n == 1
}

fn is_first(devices: &Devices) -> bool {
    *devices == Devices::default()
}

/// How a batch is drawn from the training panoramas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Every panorama once per epoch, in a new order each time.
    Shuffle,
    /// Independently, with replacement (the reference's).
    Replacement,
}

/// Optimiser of one parameter group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupConfig {
    /// Learning rate over the updates; the first update is step 0.
    pub learning_rate: LearningRate,
    /// Adam's constants.
    pub adam: AdamConfig,
}

impl TrainConfig {
    /// Reads a `config.toml`.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key and line that do not fit.
    pub fn from_toml(text: &str) -> Result<Self> {
        let mut config: Self = toml::from_str(text).map_err(|e| Error::invalid(e.to_string()))?;
        let named =
            |table: toml::Table| ["decoder_backend", "decoder_by"].iter().any(|key| table.contains_key(*key));
        if toml::from_str(text).is_ok_and(|table| !named(table)) {
            config.decoder_backend = config.device.decoder_backend();
        }
        config.check()?;
        Ok(config)
    }

    /// The text of `config.toml`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a number has no TOML form.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string_pretty(self)
            .map_err(|e| Error::invalid(format!("the configuration has no TOML form: {e}")))
    }

    /// Another device, the first of its kind, and with it what computes the decoder best there.
    pub fn set_device(&mut self, device: DeviceKind) {
        if self.device != device {
            (self.device, self.devices, self.decoder_backend) =
                (device, Devices::default(), device.decoder_backend());
        }
    }

    /// On a processor as many devices, each with its share of `threads`, as divide every batch evenly: one where there
    /// is but one thread, and of auto-decoders, whose batches are not shared. A graphics device stays one.
    pub fn share_threads(&mut self, threads: usize) {
        // what is wrong with a stage `check` will say
        let stages =
            if self.device.is_processor() && self.latents.is_none() { self.stages() } else { Ok(Vec::new()) };
        let stages = stages.unwrap_or_default();
        let batches = || stages.iter().map(|stage| stage.config.batch / stage.config.accumulate.max(1));
        let fits = |count: &usize| !stages.is_empty() && batches().all(|batch| batch.is_multiple_of(*count));
        self.devices = Devices::first((1..=threads).rev().find(fits).unwrap_or(1));
    }

    /// Parameter groups, by the first part of their parameters' paths: `decoder`, and `encoder` or `latents`.
    pub fn groups(&self) -> Vec<(&'static str, &GroupConfig)> {
        let encoder = self.encoder.iter().map(|group| ("encoder", group));
        let latents = self.latents.iter().map(|latents| ("latents", &latents.optimiser));
        [("decoder", &self.decoder)].into_iter().chain(encoder).chain(latents).collect()
    }
}
