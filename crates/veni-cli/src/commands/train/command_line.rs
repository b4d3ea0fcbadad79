//! The command that repeats a run.

use std::path::{Path, PathBuf};

use veni_light::model::Model;

use super::args::{SystemName, Train};
use super::pixel_storage::storage_key;

impl Train {
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
        if let Some(layer) = &self.layer {
            words.push(format!("--layer {}", shell_word(Path::new(layer))));
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
        let set = self.set.iter().filter(|set| storage_key(set) != Some("scratch"));
        words.extend(set.map(|set| format!("--set {}", shell_word(Path::new(set)))));
        words.push(format!("--out {}", last(&self.out)));
        words.join(" ")
    }
}

/// Quoted if a shell would split it.
pub(super) fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+,=@%".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}
