//! Weights to begin with, from a model that exists.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Table;

use crate::train::config::TrainConfig;
use crate::train::network::Network;
use crate::vae::weights::{self, Weights};
use crate::{Error, Result};
use veni_light::model::{Model, ModelKind};

/// The model whose weights a run begins with. Averages start from them, Adam's moments from 0.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitConfig {
    /// The model file. Read once, when the run is created: its weights are in the first checkpoint.
    pub model: PathBuf,
    /// Which weights these were, 16 hexadecimal digits (see [`Model::digest`]). Filled in when the run is created;
    /// where it is there already, the file must still agree.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub digest: Option<String>,
}

/// Which parts of a network were taken from a model; the others are drawn from the seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initialised {
    /// Encoder and decoder.
    Whole,
    /// The decoder alone: the model has no encoder, or the run is an auto-decoder's.
    Decoder,
}

impl InitConfig {
    /// Reads the model and fills in its digest.
    ///
    /// # Errors
    /// As [`Model::load`]; [`Error::Invalid`] if the digest is there and another one.
    pub fn open(&mut self) -> Result<Model> {
        let model = Model::load(&self.model)?;
        let found = model.digest().to_string();
        match &self.digest {
            Some(wanted) if *wanted != found => Err(Error::invalid(format!(
                "holds other weights (init.digest {found}) than the configuration was written for ({wanted}): name the \
                 right file, or remove init.digest to take this one"
            ))
            .in_file(&self.model)),
            _ => {
                self.digest = Some(found);
                Ok(model)
            }
        }
    }

    /// How a model file says it: the file's last name and the digest.
    pub fn describe(&self) -> String {
        let last = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned());
        // a run's model is called like every other's: its folder says more
        let mut name = last(&self.model).unwrap_or_default();
        if name == "model.safetensors"
            && let Some(folder) = self.model.parent().and_then(last)
        {
            name = format!("{folder}/{name}");
        }
        format!("{name} {}", self.digest.as_deref().unwrap_or_default())
    }
}

/// `network`, made for `config`, with the weights of `model` wherever it has them.
///
/// # Errors
/// [`Error::Invalid`] naming a tensor of another shape, or the first option in which the networks differ, and what to do.
pub fn apply(network: Network, config: &TrainConfig, model: &Model) -> Result<(Network, Initialised)> {
    let part = |prefix: &str| -> Weights {
        let inside = |name: &&String| name.strip_prefix(prefix).is_some_and(|rest| rest.starts_with('.'));
        let tensors = model.tensors().iter().filter(|(name, _)| inside(name));
        tensors.map(|(name, t)| (name.clone(), t.clone())).collect()
    };
    let whole = config.model.kind == ModelKind::Veni && model.has_encoder();
    let differing = differences(config, model, whole)?;
    let remedy = || match differing.first() {
        Some(first) => format!("; {first}"),
        None => String::new(),
    };
    let refuse = |e: Error| Error::invalid(format!("{e}{}", remedy()));
    let network = match network {
        Network::Veni(mut veni) => {
            veni.decoder = weights::write(veni.decoder, "decoder", &part("decoder")).map_err(refuse)?;
            if whole {
                veni.encoder = weights::write(veni.encoder, "encoder", &part("encoder")).map_err(refuse)?;
            }
            Network::Veni(veni)
        }
        Network::Reni(mut reni) => {
            reni.decoder = weights::write(reni.decoder, "decoder", &part("decoder")).map_err(refuse)?;
            Network::Reni(reni)
        }
    };
    // the same shapes may still be another network, in which the weights would mean something else
    match differing.into_iter().next() {
        Some(first) => Err(Error::invalid(first)),
        None => Ok((network, if whole { Initialised::Whole } else { Initialised::Decoder })),
    }
}

/// What the networks differ in, each with its remedy.
fn differences(config: &TrainConfig, model: &Model, whole: bool) -> Result<Vec<String>> {
    let (ours, theirs) = (&config.model, model.config());
    let mut found = Vec::new();
    if ours.latent_vectors != theirs.latent_vectors {
        found.push(format!(
            "the model has {n} latent vectors, this run {}: set model.latent_vectors={n}",
            ours.latent_vectors,
            n = theirs.latent_vectors
        ));
    }
    let mut parts = vec![("decoder", options(&ours.decoder)?, options(&theirs.decoder)?)];
    if let (true, Some(ours), Some(theirs)) = (whole, &ours.encoder, &theirs.encoder) {
        parts.push(("encoder", options(ours)?, options(theirs)?));
    }
    for (part, ours, theirs) in parts {
        let keys: BTreeSet<_> = ours.keys().chain(theirs.keys()).collect();
        for key in keys {
            let name = format!("model.{part}.{key}");
            // an option at its default is not written
            let ours_text = ours.get(key).map_or("the default".to_owned(), ToString::to_string);
            match theirs.get(key) {
                theirs if theirs == ours.get(key) => {}
                Some(theirs) => found.push(format!(
                    "the model has {name} = {theirs}, this run {ours_text}: set {name}={theirs}"
                )),
                None => found.push(format!(
                    "the model has the default of {name}, this run {ours_text}: leave this option out"
                )),
            }
        }
    }
    Ok(found)
}

fn options(part: &impl Serialize) -> Result<Table> {
    Table::try_from(part).map_err(|e| Error::invalid(format!("the network's options: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::presets::Preset;
    use burn::tensor::Device;
    use veni_light::model::ModelInfo;
    use veni_light::output::Overwrite;

    fn network(config: &TrainConfig) -> Network {
        Network::new(config, 2, &Device::flex().autodiff()).unwrap()
    }

    /// A model of the tiny preset, as another seed draws it.
    fn model() -> Model {
        let config = TrainConfig { seed: 9, ..Preset::Tiny.config(3) };
        let Network::Veni(veni) = network(&config) else { unreachable!() };
        veni.to_model(&config.model, ModelInfo::default()).unwrap()
    }

    fn taken(network: &Network, model: &Model, part: &str) -> bool {
        let weights = weights::read(network, "");
        let mut of_part = weights.iter().filter(|(name, _)| name.starts_with(part));
        of_part.all(|(name, weight)| model.tensor(name).is_some_and(|t| t.data == weight.data))
    }

    #[test]
    fn every_weight_that_the_model_has_is_taken() {
        let (model, config) = (model(), Preset::Tiny.config(3));
        assert!(!taken(&network(&config), &model, "decoder"), "the seeds differ");
        let (whole, said) = apply(network(&config), &config, &model).unwrap();
        assert_eq!(said, Initialised::Whole);
        assert!(taken(&whole, &model, "decoder") && taken(&whole, &model, "encoder"));

        let bare = model.clone().without_encoder();
        let (half, said) = apply(network(&config), &config, &bare).unwrap();
        assert_eq!(said, Initialised::Decoder);
        assert!(taken(&half, &model, "decoder") && taken(&half, &network_model(&config), "encoder"));

        let reni = Preset::Tiny.auto_decoder(3);
        let (half, said) = apply(network(&reni), &reni, &model).unwrap();
        assert_eq!(said, Initialised::Decoder);
        assert!(taken(&half, &model, "decoder"));
    }

    /// What the seed of `config` draws, as a model.
    fn network_model(config: &TrainConfig) -> Model {
        let Network::Veni(veni) = network(config) else { unreachable!() };
        veni.to_model(&config.model, ModelInfo::default()).unwrap()
    }

    #[test]
    fn what_does_not_fit_is_named_with_its_remedy() {
        let (model, config) = (model(), Preset::Tiny.config(3));
        let refused = |n: usize, set: &[&str]| {
            let config = Preset::Tiny.config(n).with_overrides(set).unwrap();
            apply(network(&config), &config, &model).unwrap_err().to_string()
        };
        let wider = refused(3, &["model.decoder.hidden=32"]);
        for word in ["tensor decoder.", "shape", "set model.decoder.hidden=16"] {
            assert!(wider.contains(word), "{wider}");
        }
        let more = refused(4, &[]);
        assert!(more.contains("tensor decoder.") && more.contains("model.latent_vectors=3"), "{more}");
        let deeper = refused(3, &["model.encoder.depth=3"]);
        assert!(deeper.contains("tensor encoder.") && deeper.contains("model.encoder.depth=2"), "{deeper}");
        // the same shapes, another network
        let other = refused(3, &["model.encoder.vn_relu=reference"]);
        assert!(other.contains("model.encoder.vn_relu=\"projection\""), "{other}");
        let other = refused(3, &["model.decoder.output=tanh"]);
        assert!(other.contains("model.decoder.output") && other.contains("leave this option out"), "{other}");
        // an encoder that is not taken does not matter
        let deeper = config.with_overrides(&["model.encoder.depth=3"]).unwrap();
        assert!(apply(network(&deeper), &deeper, &model.clone().without_encoder()).is_ok());
    }

    #[test]
    fn a_file_that_has_changed_since_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run").join("model.safetensors");
        std::fs::create_dir(folder.path().join("run")).unwrap();
        model().save(&path, veni_light::model::StoredType::F32, Overwrite::Refuse).unwrap();
        let mut init = InitConfig { model: path.clone(), digest: None };
        init.open().unwrap();
        assert_eq!(init.describe(), format!("run/model.safetensors {}", model().digest()));
        init.open().unwrap();
        network_model(&Preset::Tiny.config(3))
            .save(&path, veni_light::model::StoredType::F32, Overwrite::Replace)
            .unwrap();
        let message = init.open().unwrap_err().to_string();
        assert!(message.contains("model.safetensors") && message.contains("init.digest"), "{message}");
    }
}
