//! The model that `--model` names.

use std::path::{Path, PathBuf};

#[cfg(feature = "pretrained")]
use anyhow::Context;
use anyhow::{Result, bail};
use veni_light::model::Model;

use crate::args::ModelArgs;
use crate::piped;
use crate::report::Report;

/// A model, what to call it in messages, and what its codes have beside vectors and lights.
pub(crate) struct Loaded {
    pub(crate) model: Model,
    pub(crate) name: String,
    /// The lobes of a panorama's code, unless another number is asked for.
    pub(crate) lobes: usize,
}

impl Loaded {
    /// Says that a random sky has none of the lobes that the chosen size is about.
    pub(crate) fn note_random(&self, report: Report) {
        if self.lobes > 0 {
            report.note(format_args!(
                "note: a random sky has no lobes, which describe the detail of a panorama; it is that of the model of latent dimension {}",
                3 * self.model.latent_vectors()
            ));
        }
    }
}

/// The model of `--model`: a file, the folder of a training run, or one inside the program, by its name.
pub(crate) fn model(args: &ModelArgs) -> Result<Loaded> {
    let Some(path) = &args.model else {
        return embedded(SMALLEST);
    };
    if let Some(name) = path.to_str().filter(|name| is_embedded_name(name) && !path.exists()) {
        return embedded(name);
    }
    let path = piped::input(&model_file(path)?)?;
    Ok(Loaded { model: Model::load(&path)?, name: path.display().to_string(), lobes: 0 })
}

/// The name of the model that is taken where none is named.
const SMALLEST: &str = "27";

/// A model inside the program, as `--model` names it.
struct Embedded {
    name: &'static str,
    /// D = 3N of its vectors.
    dimension: usize,
    lobes: usize,
}

/// The models that may be inside the program. The size of a code is 3N + 7M + 7K with N vectors, M lights (here one) and K lobes;
/// docs/DECISIONS.md says why larger codes have lobes and not more vectors.
const EMBEDDED: [Embedded; 5] = [
    Embedded { name: SMALLEST, dimension: 27, lobes: 0 },
    Embedded { name: "147", dimension: 27, lobes: 16 },
    Embedded { name: "300", dimension: 27, lobes: 38 },
    Embedded { name: "vectors-147", dimension: 147, lobes: 0 },
    Embedded { name: "vectors-300", dimension: 300, lobes: 0 },
];

/// How `--model` names the model inside the program whose codes have `vectors` vectors.
pub(super) fn name_of(vectors: usize) -> &'static str {
    let found = EMBEDDED.iter().find(|e| e.dimension == 3 * vectors && e.lobes == 0);
    found.map_or(SMALLEST, |e| e.name)
}

/// One of those names, or the latent dimension of a model that is not inside; not a file.
fn is_embedded_name(name: &str) -> bool {
    EMBEDDED.iter().any(|e| e.name == name) || name.parse::<usize>().is_ok()
}

#[cfg(feature = "pretrained")]
fn embedded(name: &str) -> Result<Loaded> {
    let inside = |e: &&Embedded| Model::pretrained_sizes().any(|size| size == e.dimension);
    let Some(found) = EMBEDDED.iter().filter(inside).find(|e| e.name == name) else {
        let names: Vec<_> = EMBEDDED.iter().filter(inside).map(|e| e.name).collect();
        bail!("--model {name}: this program has models {} inside", names.join(", "));
    };
    let dimension = found.dimension;
    let model = Model::pretrained_of(dimension)
        .with_context(|| format!("no model of latent dimension {dimension}"))?;
    let name = format!("the model of latent dimension {dimension} inside this program");
    Ok(Loaded { model, name, lobes: found.lobes })
}

#[cfg(not(feature = "pretrained"))]
fn embedded(_: &str) -> Result<Loaded> {
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
