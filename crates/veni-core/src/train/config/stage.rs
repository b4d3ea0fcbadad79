//! A run in stages: the run's own settings with some changed for a number of updates.
//!
//! ```toml
//! steps = 24000                       # the sum of the stages
//! # … all other settings of the run
//!
//! [[stage]]
//! name = "pretrain"
//! steps = 12000
//! data.folders = ["expanded-ldr"]
//!
//! [[stage]]
//! name = "finetune"
//! steps = 12000
//! decoder.learning_rate.rate = 1e-4
//! encoder.learning_rate.rate = 1e-4
//! ```
//!
//! A stage begins with the weights, averages and moments that the one before it left. Learning rates and weights of
//! losses count from its own first update; a learning rate that falls until the run's last step falls until the stage's.
//! Validation, previews and the stored prior are those of the run's own `data` throughout.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::TrainConfig;
use super::overrides::{float_where_float, rename_former};
use crate::{Error, Result};
use veni_data::PixelStorage;
use veni_light::model::ModelKind;

/// What a stage may change: what neither the network, nor its state, nor the run's reports depend on.
const CHANGEABLE: [&str; 10] =
    ["accumulate", "augment", "batch", "data", "decoder", "encoder", "latents", "loss", "loss_grid", "order"];

/// A stage, as it stands in `config.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageConfig {
    /// What log and progress call it.
    pub name: String,
    /// Number of updates.
    pub steps: u64,
    /// What differs, by the names that the settings have in the run's configuration. Tables are merged key by key; a
    /// schedule of another kind, and the weight of a loss, are replaced whole. Not public: another major version of the library for
    /// TOML would be another type here.
    #[serde(flatten)]
    pub(in crate::train) changes: Table,
}

/// A stage, ready to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Its name; absent in a run that has no stages.
    pub name: Option<String>,
    /// Updates made before it.
    pub first: u64,
    /// Whether it has training panoramas of its own, named by `config.data`.
    pub own_data: bool,
    /// Its settings, complete; `steps` are its own.
    pub config: TrainConfig,
}

impl Stage {
    /// Updates made when it ends.
    pub fn end(&self) -> u64 {
        self.first + self.config.steps
    }
}

impl TrainConfig {
    /// The stages in order, at least one: a run without any is one stage.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the stage and the key that does not fit.
    pub fn stages(&self) -> Result<Vec<Stage>> {
        if self.stage.is_empty() {
            return Ok(vec![Stage { name: None, first: 0, own_data: false, config: self.clone() }]);
        }
        let mut first = 0;
        let mut stages = Vec::with_capacity(self.stage.len());
        for (index, stage) in (0..).zip(&self.stage) {
            let config = self.with_stage(index, stage);
            let config = config.map_err(|e| Error::invalid(format!("stage {}: {e}", stage.name)))?;
            let own_data = stage.changes.contains_key("data");
            first += config.steps;
            let before = first - config.steps;
            stages.push(Stage { name: Some(stage.name.clone()), first: before, own_data, config });
        }
        Ok(stages)
    }

    /// The same run with its panoramas, those of all stages too, kept as `storage` says.
    #[must_use]
    pub fn with_pixel_storage(mut self, storage: &PixelStorage) -> Self {
        let PixelStorage { memory_mib, scratch } = storage;
        let given = [memory_mib.is_some(), scratch.is_some()];
        for stage in &mut self.stage {
            if let Some(Value::Table(data)) = stage.changes.get_mut("data") {
                for (key, _) in PixelStorage::KEYS.iter().zip(given).filter(|(_, given)| *given) {
                    data.remove(*key);
                }
            }
        }
        self.data.memory_mib = memory_mib.unwrap_or(self.data.memory_mib);
        self.data.scratch = scratch.clone().or(self.data.scratch);
        self
    }

    fn with_stage(&self, index: u64, stage: &StageConfig) -> Result<Self> {
        if let Some(key) = stage.changes.keys().find(|key| !CHANGEABLE.contains(&key.as_str())) {
            return Err(Error::invalid(format!(
                "{key} is the same in all stages of a run; a stage may change {}",
                CHANGEABLE.join(", ")
            )));
        }
        let whole = Self { stage: Vec::new(), init: None, ..self.clone() };
        let text = |e: &dyn std::fmt::Display| Error::invalid(e.to_string());
        let mut table = Table::try_from(&whole).map_err(|e| text(&e))?;
        let mut changes = stage.changes.clone();
        rename_former(&mut changes);
        if let Some(Value::Table(data)) = changes.get_mut("data")
            && data.contains_key("folders")
        {
            // validation panoramas are the run's: of other folders all are for training
            data.entry("val_share").or_insert(Value::Float(0.0));
        }
        merge(&mut table, &changes, false);
        let mut config: Self = table.try_into().map_err(|e: toml::de::Error| text(&e.message()))?;
        if let Some(Value::Table(data)) = changes.get("data")
            && data.contains_key("folders")
        {
            // what validates is left out of every stage anyway; a part of other folders would be lost
            config.data.fold = None;
        }
        config.set_steps(stage.steps);
        // as if each stage were a run of its own; the first one is the run without stages
        config.seed ^= index.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        Ok(config)
    }

    pub(super) fn check_stages(&self) -> Result<()> {
        if self.stage.is_empty() {
            return Ok(());
        }
        let sum: u64 = self.stage.iter().map(|stage| stage.steps).sum();
        if sum != self.steps {
            return Err(Error::invalid(format!(
                "steps = {}, but the stages make {sum}: give their sum, or change stage.NAME.steps",
                self.steps
            )));
        }
        for (at, stage) in self.stage.iter().enumerate() {
            let name = &stage.name;
            let refuse = |why: &str| Err(Error::invalid(format!("stage {name}: {why}")));
            if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || "-_".contains(c)) {
                return refuse("a name consists of letters, digits, - and _");
            }
            if self.stage[..at].iter().any(|other| other.name == *name) {
                return refuse("two stages have this name; rename one");
            }
            if stage.steps == 0 {
                return refuse("steps = 0: leave the stage out");
            }
            if self.model.kind == ModelKind::Reni && stage.changes.contains_key("data") {
                return refuse(
                    "an auto-decoder's latents belong to its panoramas, so that a stage cannot have other data: train \
                     on it in a run of its own, and begin the next one with that one's model (init)",
                );
            }
        }
        for stage in self.stages()? {
            let free = |config: &Self| config.latents.as_ref().map(|latents| latents.free_exposure);
            let name = stage.name.unwrap_or_default();
            if free(&stage.config) != free(self) {
                return Err(Error::invalid(format!(
                    "stage {name}: latents.free_exposure is the same in all stages"
                )));
            }
            stage.config.check().map_err(|e| Error::invalid(format!("stage {name}: {e}")))?;
        }
        Ok(())
    }
}

/// Puts `changes` over `base`. `whole`: tables are values, not to be merged.
fn merge(base: &mut Table, changes: &Table, whole: bool) {
    for (key, change) in changes {
        match (base.get_mut(key), change) {
            (Some(Value::Table(base)), Value::Table(change)) if !whole && !is_of_other_kind(base, change) => {
                merge(base, change, key == "loss");
            }
            (old, new) => {
                let new = float_where_float(old.as_deref(), new.clone());
                base.insert(key.clone(), new);
            }
        }
    }
}

fn is_of_other_kind(base: &Table, change: &Table) -> bool {
    change.get("kind").is_some_and(|kind| base.get("kind") != Some(kind))
}
