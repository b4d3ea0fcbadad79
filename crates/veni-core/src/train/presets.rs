//! Named starting points: `tiny` for tests, `small` for two cores, `paper` for a graphics card.

use crate::data::{AugmentConfig, DataConfig};
use crate::model::{DecoderConfig, EncoderConfig, ModelConfig, ModelKind};
use crate::train::config::{DeviceKind, GroupConfig, LossGrid, Order, ReportConfig, Stored, TrainConfig};
use crate::train::loss::LossConfig;
use crate::train::optimiser::AdamConfig;
use crate::train::schedule::Schedule;
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
    /// The configuration for N latent vectors, without data folders.
    pub fn config(self, latent_vectors: usize) -> TrainConfig {
        match self {
            Self::Tiny => tiny(latent_vectors),
            Self::Small => small(latent_vectors),
            Self::Paper => paper(latent_vectors),
        }
    }
}
