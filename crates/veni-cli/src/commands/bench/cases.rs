//! What is baked: the decoders to compare.

use anyhow::{Result, anyhow};
use veni_light::latent::Latent;
use veni_light::model::{Model, ModelConfig};

use crate::args::ModelArgs;
use crate::report::Report;
use crate::source;

/// A model and a latent of it.
pub(super) struct Case {
    /// What to call the model in results.
    pub(super) name: String,
    pub(super) model: Model,
    pub(super) latent: Latent,
}

impl Case {
    pub(super) fn new(name: impl Into<String>, model: Model) -> Self {
        let latent = Latent::from_seed(&model.prior(), 1);
        Self { name: name.into(), model, latent }
    }

    /// Floating-point operations of the folded network for one direction.
    pub(super) fn operations(&self) -> f64 {
        2.0 * multiply_adds(self.model.config()) as f64
    }
}

/// The model that was named, or the one inside, and one by formula for each number of latent vectors.
pub(super) fn all(args: &ModelArgs, latent_vectors: &[usize], report: Report) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    match (source::model(args), &args.model) {
        (Ok(loaded), Some(path)) => {
            let name = path.file_name().map_or(loaded.name, |name| name.to_string_lossy().into_owned());
            cases.push(Case::new(name, loaded.model));
        }
        (Ok(loaded), None) => cases.push(Case::new("embedded", loaded.model)),
        (Err(error), Some(_)) => return Err(error),
        // a build without a model can still measure the others
        (Err(error), None) => report.note(format_args!("note: {error:#}")),
    }
    for n in latent_vectors {
        let model = Model::filler(&ModelConfig::decode_only(*n), 1)
            .map_err(|e| anyhow!("--latent-vectors {n}: {e}"))?;
        cases.push(Case::new("formula", model));
    }
    Ok(cases)
}

/// Multiply-adds for one direction: five inputs for each latent vector and each of the two others, two square products
/// a layer, three outputs.
fn multiply_adds(config: &ModelConfig) -> usize {
    let (n, hidden, layers) = (config.latent_vectors, config.decoder.hidden, config.decoder.layers);
    5 * (n + 2) * hidden + 2 * layers * hidden * hidden + 3 * hidden
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_of_the_papers_decoder() {
        assert_eq!(multiply_adds(&ModelConfig::decode_only(9)), 5 * 11 * 128 + 12 * 128 * 128 + 384);
    }

    #[cfg(feature = "gpu")]
    #[test]
    fn both_devices_are_measured_by_the_same_count() {
        for n in [1, 9, 100] {
            let config = ModelConfig::decode_only(n);
            assert_eq!(multiply_adds(&config), veni_gpu::shader::Sizes::from(&config).multiply_adds());
        }
    }
}
