//! Named starting points: `tiny` for tests, `small` for two cores, `paper` for a graphics card.

use std::path::PathBuf;

use toml::{Table, Value};

use crate::train::config::{GroupConfig, StageConfig, TrainConfig};
use crate::{Error, Result};
use veni_fit::schedule::LearningRate;

mod auto_decoder;
mod auto_encoder;

/// A named configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// A model that trains a step in milliseconds: for tests and to see the machinery work.
    Tiny,
    /// As good as an hour on two cores can buy.
    Small,
    /// The paper's sizes and the reference implementation's optimisation.
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
            Self::Tiny => auto_encoder::tiny(latent_vectors),
            Self::Small => auto_encoder::small(latent_vectors),
            Self::Paper => auto_encoder::paper(latent_vectors),
        }
    }

    /// The auto-decoder RENI++ for N latent vectors, with the decoder of [`config`](Self::config) and without data
    /// folders. Losses, rates and rays are the reference's; only steps, rays and their validation depend on the preset.
    pub fn auto_decoder(self, latent_vectors: usize) -> TrainConfig {
        auto_decoder::preset(self, latent_vectors)
    }
}

/// How much lower the learning rates of fine-tuning are: the reference's (1e-5 and 1e-4 after 1e-4 and 1e-3).
const FINE: f64 = 10.0;

impl TrainConfig {
    /// The same run behind a stage `pretrain` of `steps` updates on other panoramas and this many generated scenes; its own
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
