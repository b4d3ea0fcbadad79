//! From the command line to the configuration of a run.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use veni_light::Error;
use veni_light::model::Model;
use veni_core::train::config::{DecoderBy, TrainConfig};
use veni_core::train::init::InitConfig;
use veni_core::train::presets::Preset;

use super::resume::held_by;
use super::{PresetName, SystemName, Train, shell_word};
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
            config.decoder_by = DecoderBy::KernelsBfloat16;
        }
        if let Some(steps) = self.steps {
            config = config.with_overrides(&[format!("steps={steps}")])?;
        }
        if let Some(init) = &self.init {
            config.init = Some(InitConfig { model: source::model_file(init)?, digest: None });
        }
        if self.pretrains() {
            let (steps, scenes) = (self.pretrain_steps.unwrap_or(config.steps), self.pretrain_synthetic);
            config =
                config.pretrained_on(&self.pretrain, scenes.unwrap_or(0), steps).context("--pretrain")?;
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
        if self.mixed_precision && config.decoder_by != DecoderBy::KernelsBfloat16 {
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

    /// The command that repeats this run, for the model file. A model is given away: of a path only its last name
    /// is recorded.
    pub(super) fn command_line(&self) -> String {
        if self.resume {
            // what began the run, as far as it is known
            let model = Model::load(self.out.join("model.safetensors")).ok();
            let begun = model.and_then(|m| m.info().training.as_ref().map(|t| t.command.clone()));
            return begun.unwrap_or_else(|| "veni-cli train --config config.toml".to_owned());
        }
        let last = |path: &PathBuf| shell_word(path.file_name().map_or(path, Path::new));
        let mut words = vec!["veni-cli train".to_owned()];
        for folder in &self.data {
            words.push(format!("--data {}", last(folder)));
        }
        if let Some(fold) = self.fold {
            words.push(format!("--fold {fold}"));
        }
        if let Some(config) = &self.config {
            words.push(format!("--config {}", last(config)));
        }
        for folder in &self.pretrain {
            words.push(format!("--pretrain {}", last(folder)));
        }
        if let Some(init) = &self.init {
            words.push(format!("--init {}", last(init)));
        }
        if self.system == Some(SystemName::Reni) {
            words.push("--system reni++".to_owned());
        }
        if let Some(preset) = self.preset {
            words.push(format!("--preset {}", format!("{preset:?}").to_lowercase()));
        }
        let numbers = [
            ("--latent-vectors", self.latent_vectors.map(|n| n as u64)),
            ("--seed", self.seed),
            ("--steps", self.steps),
            ("--pretrain-synthetic", self.pretrain_synthetic.map(|n| n as u64)),
            ("--pretrain-steps", self.pretrain_steps),
            ("--synthetic", self.synthetic.map(|n| n as u64)),
        ];
        words.extend(numbers.into_iter().filter_map(|(name, n)| Some(format!("{name} {}", n?))));
        words.extend(self.devices.iter().map(|devices| format!("--devices {devices}")));
        words.extend(self.mixed_precision.then(|| "--mixed-precision".to_owned()));
        // where panoramas were kept meanwhile changes nothing, and is a path of this machine
        let set = self.set.iter().filter(|set| held_by(set) != Some("scratch"));
        words.extend(set.map(|set| format!("--set {}", shell_word(Path::new(set)))));
        words.push(format!("--out {}", last(&self.out)));
        words.join(" ")
    }
}

pub(super) fn read(path: &Path) -> Result<TrainConfig> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
    TrainConfig::from_toml(&text).map_err(|e| anyhow!("{}", e.in_file(path)))
}
