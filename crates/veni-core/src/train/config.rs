//! Everything that defines a training run, as stored in its `config.toml`.

use serde::{Deserialize, Serialize};

use crate::data::{AugmentConfig, DataConfig};
use crate::model::{ModelConfig, ModelKind, StoredType};
use crate::train::latents::LatentsConfig;
use crate::train::loss::LossConfig;
use crate::train::optimiser::AdamConfig;
use crate::train::schedule::LearningRate;
use crate::{Error, Result};

/// A training run. Which system is trained is said by `model.kind`: the auto-encoder VENI, or the auto-decoder
/// RENI++.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Seed of everything random.
    pub seed: u64,
    /// Number of updates.
    pub steps: u64,
    /// Panoramas per step.
    pub batch: usize,
    /// How a batch is drawn.
    pub order: Order,
    /// Where gradients are computed.
    pub device: DeviceKind,
    /// What computes the decoder and its gradients.
    #[serde(default)]
    pub decoder_by: DecoderBy,
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
}

/// How a batch is drawn from the training panoramas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Every panorama once per epoch, in a new order each time.
    Shuffle,
    /// Independently, with replacement (the authors').
    Replacement,
}

/// What computes the decoder and its gradients in training: the same numbers up to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DecoderBy {
    /// The vectorised kernels of [`field`](crate::field), on the processor ([`Native`](crate::vae::Native)). A network
    /// that does not fold per latent is computed by tensor operations all the same.
    #[default]
    Kernels,
    /// Tensor operations on the device.
    Tensors,
}

/// Where gradients are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceKind {
    /// burn's flex CPU backend.
    #[default]
    Flex,
    /// burn's ndarray CPU backend (feature `ndarray`).
    Ndarray,
}

impl DeviceKind {
    /// The device, without gradient tracking.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if it is not compiled in.
    pub fn device(self) -> Result<burn::tensor::Device> {
        match self {
            Self::Flex => Ok(burn::tensor::Device::flex()),
            #[cfg(feature = "ndarray")]
            #[allow(deprecated, reason = "kept and tested while burn ships it")]
            Self::Ndarray => Ok(burn::tensor::Device::ndarray()),
            #[cfg(not(feature = "ndarray"))]
            Self::Ndarray => {
                Err(Error::unsupported("device ndarray is not compiled in; build with --features ndarray"))
            }
        }
    }
}

/// Directions on which the losses are computed in training (validation always takes every pixel).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum LossGrid {
    /// Every pixel of the panorama.
    Full,
    /// The panorama averaged over `factor` × `factor` pixels by solid angle, in log radiance.
    Averaged {
        /// Pixels per side of a cell; must divide width and height.
        factor: usize,
    },
    /// Every `factor`-th pixel of every `factor`-th row, from an offset drawn anew in each step: exact pixel
    /// values, and every pixel in its turn. (Rows are weighted as if each were in the middle of its
    /// neighbours; over the offsets that evens out.)
    Strided {
        /// Distance of neighbours in pixels; must divide width and height.
        factor: usize,
    },
}

impl LossGrid {
    /// Pixels of the panorama per pixel of the loss grid, along each side.
    pub fn factor(self) -> usize {
        match self {
            Self::Full => 1,
            Self::Averaged { factor } | Self::Strided { factor } => factor,
        }
    }
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

/// What a run writes beside its weights, and how often.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReportConfig {
    /// Steps between validations; 0 validates only at the end.
    pub validate_every: u64,
    /// Steps between preview images; 0 writes only the last.
    pub preview_every: u64,
    /// Steps between checkpoints; 0 writes only the last.
    pub checkpoint_every: u64,
    /// Training panoramas that are validated too (the first ones), to see overfitting.
    pub train_subset: usize,
    /// Augmented copies per training panorama whose posteriors the stored prior is fitted to.
    pub prior_copies: usize,
    /// Precision of the stored model.
    pub stored: Stored,
}

/// Precision of weights in `model.safetensors`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stored {
    /// Half precision.
    F16,
    /// Single precision.
    F32,
}

impl From<Stored> for StoredType {
    fn from(stored: Stored) -> Self {
        match stored {
            Stored::F16 => Self::F16,
            Stored::F32 => Self::F32,
        }
    }
}

impl TrainConfig {
    /// The configuration with dotted keys replaced: each override is `key.path=value`, the value in TOML
    /// (bare words are taken as strings). With `steps`, learning rates that fell until the old last step fall
    /// until the new one.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the override that has no `=`, no such key, or a value of the wrong type.
    pub fn with_overrides<S: AsRef<str>>(&self, overrides: &[S]) -> Result<Self> {
        let broken =
            |text: &str, e: &dyn std::fmt::Display| Error::invalid(format!("override `{text}`: {e}"));
        let mut config = self.clone();
        for text in overrides.iter().map(AsRef::as_ref) {
            let (path, value) = text.split_once('=').ok_or_else(|| broken(text, &"has no `=`"))?;
            let mut table = toml::Table::try_from(&config).map_err(|e| broken(text, &e))?;
            let value = parse_value(value.trim());
            set(&mut table, path.trim(), value).map_err(|e| broken(text, &e))?;
            let steps = config.steps;
            config = table.try_into().map_err(|e: toml::de::Error| broken(text, &e.message()))?;
            if config.steps != steps {
                let second = config.latents.as_mut().map(|l| &mut l.optimiser).or(config.encoder.as_mut());
                for group in [Some(&mut config.decoder), second].into_iter().flatten() {
                    match &mut group.learning_rate {
                        LearningRate::Cosine { steps: end, .. }
                        | LearningRate::Exponential { steps: end, .. }
                            if *end == steps =>
                        {
                            *end = config.steps;
                        }
                        _ => {}
                    }
                }
            }
        }
        Ok(config)
    }

    /// Reads a `config.toml`.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key and line that do not fit.
    pub fn from_toml(text: &str) -> Result<Self> {
        let config: Self = toml::from_str(text).map_err(|e| Error::invalid(e.to_string()))?;
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

    /// Checks what types cannot.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key, its value and what is allowed.
    pub fn check(&self) -> Result<()> {
        self.model.validate()?;
        self.augment.check()?;
        self.check_system()?;
        let factor = self.loss_grid.factor();
        let (w, h) = (self.data.width, self.data.height);
        if factor == 0 || !w.is_multiple_of(factor) || !h.is_multiple_of(factor) {
            return Err(Error::invalid(format!(
                "loss_grid.factor = {factor} does not divide {w} × {h} pixels"
            )));
        }
        if self.batch == 0 {
            return Err(Error::invalid("batch = 0: needs at least one panorama per step"));
        }
        if !(0.0..1.0).contains(&self.ema_decay) {
            return Err(Error::invalid(format!("ema_decay = {}: must lie in 0..1", self.ema_decay)));
        }
        for (name, group) in self.groups() {
            let ends = [0, self.steps / 2, self.steps].map(|step| group.learning_rate.at(step));
            if let Some(rate) = ends.into_iter().find(|rate| !(*rate >= 0.0 && rate.is_finite())) {
                return Err(Error::invalid(format!(
                    "{name}.learning_rate = {rate}: must be finite and at least 0"
                )));
            }
        }
        Ok(())
    }
}

impl TrainConfig {
    /// Parameter groups, by the first part of their parameters' paths: `decoder`, and `encoder` or `latents`.
    pub fn groups(&self) -> Vec<(&'static str, &GroupConfig)> {
        let encoder = self.encoder.iter().map(|group| ("encoder", group));
        let latents = self.latents.iter().map(|latents| ("latents", &latents.optimiser));
        [("decoder", &self.decoder)].into_iter().chain(encoder).chain(latents).collect()
    }

    /// What the two systems need, and must not have.
    fn check_system(&self) -> Result<()> {
        let missing = |what: &str, system: &str| Err(Error::invalid(format!("{what} is missing: {system}")));
        let foreign = |what: &str, system: &str| Err(Error::invalid(format!("{what}: {system} has none")));
        match self.model.kind {
            ModelKind::Veni => {
                let system = "an auto-encoder (model.kind = veni) is trained";
                match (&self.model.encoder, &self.encoder, &self.latents) {
                    (None, _, _) => missing("model.encoder", system),
                    (_, None, _) => missing("encoder", system),
                    (_, _, Some(_)) => foreign("latents", "an auto-encoder (model.kind = veni)"),
                    (Some(_), Some(_), None) => Ok(()),
                }
            }
            ModelKind::Reni => {
                let system = "an auto-decoder (model.kind = reni)";
                match (&self.model.encoder, &self.encoder, &self.latents) {
                    (Some(_), _, _) => return foreign("model.encoder", system),
                    (_, Some(_), _) => return foreign("encoder", system),
                    (_, _, None) => return missing("latents", &format!("{system} is trained")),
                    (None, None, Some(latents)) => latents.check(self.batch)?,
                }
                if !self.loss.mage.is_off() {
                    return foreign("loss.mage", "a set of rays, which an auto-decoder is trained on,");
                }
                if self.loss_grid != LossGrid::Full {
                    return foreign(
                        "loss_grid",
                        "an auto-decoder, which is trained on rays (leave it full),",
                    );
                }
                if self.augment != AugmentConfig::default() {
                    let system = "an auto-decoder, whose latents belong to the panoramas as they are,";
                    return foreign("augment", system);
                }
                Ok(())
            }
        }
    }
}

/// `value` as TOML; what TOML cannot read is a bare string.
fn parse_value(value: &str) -> toml::Value {
    let parsed = format!("x = {value}").parse::<toml::Table>().ok().and_then(|mut table| table.remove("x"));
    parsed.unwrap_or_else(|| toml::Value::String(value.to_owned()))
}

fn set(table: &mut toml::Table, path: &str, value: toml::Value) -> Result<(), String> {
    let (first, rest) = path.split_once('.').map_or((path, None), |(a, b)| (a, Some(b)));
    match rest {
        None => {
            // an integer where a float stands is meant as a float
            let value = match (table.get(first), value) {
                (Some(toml::Value::Float(_)), toml::Value::Integer(i)) => toml::Value::Float(i as f64),
                (_, value) => value,
            };
            table.insert(first.to_owned(), value);
            Ok(())
        }
        Some(rest) => match table.get_mut(first) {
            Some(toml::Value::Table(inner)) => set(inner, rest, value),
            Some(_) => Err(format!("`{first}` holds no further keys")),
            None => Err(format!("there is no `{first}`")),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::presets::Preset;

    #[test]
    fn presets_survive_their_file() {
        for preset in [Preset::Tiny, Preset::Small, Preset::Paper] {
            for config in [preset.config(9), preset.auto_decoder(9)] {
                config.check().unwrap();
                assert_eq!(TrainConfig::from_toml(&config.to_toml().unwrap()).unwrap(), config);
            }
        }
    }

    #[test]
    fn overrides_reach_every_level_and_keep_types() {
        let config = Preset::Small.config(9);
        let changed = config
            .with_overrides(&[
                "steps=500",
                "loss.kld=1",
                "model.encoder.depth=2",
                "device=ndarray",
                "order = shuffle",
            ])
            .unwrap();
        assert_eq!(changed.steps, 500);
        assert_eq!(changed.loss.kld, crate::train::schedule::WeightSchedule::Constant(1.0));
        assert_eq!(changed.model.encoder.as_ref().unwrap().depth, 2);
        assert_eq!((changed.device, changed.order), (DeviceKind::Ndarray, Order::Shuffle));
        assert_eq!(changed.decoder.learning_rate.at(500), config.decoder.learning_rate.at(config.steps));
        let grid = config.with_overrides(&[r#"loss_grid={kind="averaged", factor=4}"#]).unwrap();
        assert_eq!(grid.loss_grid, LossGrid::Averaged { factor: 4 });
    }

    #[test]
    fn what_is_wrong_is_named() {
        let config = Preset::Small.config(9);
        let refused = |text: &str| config.with_overrides(&[text]).unwrap_err().to_string();
        assert!(refused("stepz=5").contains("stepz"));
        assert!(refused("loss.nothing.deeper=5").contains("nothing"));
        assert!(refused("steps").contains("no `=`"));
        assert!(refused("steps=many").contains("steps=many"));
        let checked = |text: &str| config.with_overrides(&[text]).unwrap().check().unwrap_err().to_string();
        assert!(checked("loss_grid.factor=3").contains("loss_grid.factor = 3"));
        assert!(checked("batch=0").contains("batch = 0"));
        assert!(checked("ema_decay=1.0").contains("ema_decay = 1"));
        assert!(checked("augment.mix=2.0").contains("augment.mix = 2"));
    }
    #[test]
    fn what_belongs_to_the_other_system_is_refused() {
        let refused = |config: &TrainConfig, text: &[&str]| {
            config.with_overrides(text).unwrap().check().unwrap_err().to_string()
        };
        let reni = Preset::Small.auto_decoder(9);
        assert!(refused(&reni, &["augment.mirror=0.5"]).contains("augment"));
        assert!(refused(&reni, &["loss.mage=0.5"]).contains("loss.mage"));
        assert!(refused(&reni, &["model.kind=veni"]).contains("model.encoder is missing"));
        assert!(refused(&reni, &["latents.rays=3"]).contains("latents.rays = 3"));
        assert!(refused(&Preset::Small.config(9), &["model.kind=reni"]).contains("model.encoder"));
        let mut veni = Preset::Small.config(9);
        veni.latents.clone_from(&reni.latents);
        assert!(veni.check().unwrap_err().to_string().contains("latents"));
        let short = reni.with_overrides(&["steps=500"]).unwrap().latents.unwrap().optimiser.learning_rate;
        assert_eq!(short.at(500), reni.latents.unwrap().optimiser.learning_rate.at(reni.steps));
    }
}
