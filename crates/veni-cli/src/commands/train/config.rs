//! From the command line to the configuration of a run.

use std::path::Path;

use anyhow::{Context, Result, bail};
use veni_core::train::config::{DecoderBackend, TrainConfig};
use veni_core::train::init::InitConfig;
use veni_core::train::presets::Preset;
use veni_light::limits::{MAX_SETTINGS_BYTES, read_text};
use veni_light::model::ModelKind;

use super::args::{PresetName, SystemName, Train};
use crate::source;

impl Train {
    /// All settings: preset or file, then the options, then `--set`.
    pub(super) fn settings(&self) -> Result<TrainConfig> {
        let mut config = match &self.config {
            Some(path) => read(path)?,
            None => {
                let preset = Preset::from(self.preset.unwrap_or(PresetName::Small));
                let n = self.latent_vectors.unwrap_or(9);
                match self.system.unwrap_or_default() {
                    SystemName::Veni => preset.config(n),
                    SystemName::Reni => preset.auto_decoder(n),
                }
            }
        };
        if !self.data.is_empty() {
            config.data.folders = self.data.clone();
        }
        if let Some(fold) = self.fold {
            config.data.fold = Some(fold);
        }
        if let Some(synthetic) = self.synthetic {
            config.data.synthetic = synthetic;
        }
        if let Some(seed) = self.seed {
            config.seed = seed;
        }
        if let Some(device) = self.device {
            config.set_device(device.into());
        }
        if self.mixed_precision {
            if !config.device.is_processor() {
                bail!(
                    "--mixed-precision: the decoder is computed by tensor operations on this device; it is for --device \
                     flex and ndarray"
                );
            }
            config.decoder_backend = DecoderBackend::KernelsBfloat16;
        }
        if let Some(steps) = self.steps {
            config = config.with_overrides(&[format!("steps={steps}")])?;
        }
        if let Some(init) = &self.init {
            config.init = Some(InitConfig { model: source::model_file(init)?, digest: None });
        }
        if self.pretrains() {
            // its latents belong to its panoramas, so that two runs take the place of two stages
            let is_decoder = config.model.kind == ModelKind::Reni;
            let option = if is_decoder { "--pretrain (begin with --init instead)" } else { "--pretrain" };
            let (steps, scenes) = (self.pretrain_steps.unwrap_or(config.steps), self.pretrain_synthetic);
            config = config.pretrained_on(&self.pretrain, scenes.unwrap_or(0), steps).context(option)?;
        } else if self.pretrain_steps.is_some() {
            bail!(
                "--pretrain-steps: there is nothing to pre-train on; give --pretrain or --pretrain-synthetic"
            );
        }
        let mut config = config.with_overrides(&self.set).context("--set")?;
        if let Some(devices) = &self.devices {
            config.devices.clone_from(devices);
        } else if !self.names_devices() {
            config.share_threads(rayon::current_num_threads());
        }
        if self.mixed_precision && config.decoder_backend != DecoderBackend::KernelsBfloat16 {
            bail!("--mixed-precision: a --set takes it back; leave one of them out");
        }
        config.check()?;
        Ok(config)
    }

    /// Whether it is said which devices of their kind compute, if by a file that does not mention them.
    pub(super) fn names_devices(&self) -> bool {
        let set = self.set.iter().filter_map(|set| set.split_once('='));
        self.devices.is_some()
            || self.config.is_some()
            || set.into_iter().any(|(key, _)| key.trim() == "devices")
    }

    pub(super) fn pretrains(&self) -> bool {
        !self.pretrain.is_empty() || self.pretrain_synthetic.is_some()
    }
}

pub(super) fn read(path: &Path) -> Result<TrainConfig> {
    let text = read_text(path, "a configuration", MAX_SETTINGS_BYTES)?;
    Ok(TrainConfig::from_toml(&text).map_err(|e| e.in_file(path))?)
}
