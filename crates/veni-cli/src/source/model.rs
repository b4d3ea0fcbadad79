//! The model that `--model` names.

use std::path::{Path, PathBuf};

#[cfg(feature = "pretrained")]
use anyhow::anyhow;
use anyhow::{Result, bail};
use veni_light::model::Model;

use crate::args::ModelArgs;
use crate::piped;

/// A model and what to call it in messages.
pub(crate) struct Loaded {
    pub(crate) model: Model,
    pub(crate) name: String,
}

/// The model of `--model`: a file, the folder of a training run, or one inside the program, by its latent dimension.
pub(crate) fn model(args: &ModelArgs) -> Result<Loaded> {
    let Some(path) = &args.model else {
        return embedded(SMALLEST);
    };
    if let Some(dimension) = size(path) {
        return embedded(dimension);
    }
    let path = piped::input(&model_file(path)?)?;
    Ok(Loaded { model: Model::load(&path)?, name: path.display().to_string() })
}

/// Latent dimension of the model that is taken where none is named.
const SMALLEST: usize = 27;

/// A latent dimension, not the name of a file or folder.
fn size(path: &Path) -> Option<usize> {
    path.to_str()?.parse().ok().filter(|_| !path.exists())
}

#[cfg(feature = "pretrained")]
fn embedded(dimension: usize) -> Result<Loaded> {
    let model = Model::pretrained_of(dimension).ok_or_else(|| {
        let sizes: Vec<_> = Model::pretrained_sizes().map(|size| size.to_string()).collect();
        anyhow!(
            "--model {dimension}: this program has models of latent dimension {} inside",
            sizes.join(", ")
        )
    })?;
    Ok(Loaded { model, name: format!("the model of latent dimension {dimension} inside this program") })
}

#[cfg(not(feature = "pretrained"))]
fn embedded(_: usize) -> Result<Loaded> {
    bail!("this build has no model inside: name a model file with --model FILE")
}

/// The file that a model, or the folder of a training run, names.
pub(crate) fn model_file(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let inside = path.join("model.safetensors");
    if !inside.is_file() {
        bail!("{}: a folder without model.safetensors; name a model file or a finished run", path.display());
    }
    Ok(inside)
}
