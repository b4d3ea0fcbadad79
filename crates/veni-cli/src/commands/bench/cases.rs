//! What is baked: the decoders to compare.

use anyhow::{Result, anyhow};
use veni_light::latent::{Latent, Lobe};
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
    /// With a random latent, to which `lobes` lobes are added.
    pub(super) fn new(name: impl Into<String>, model: Model, lobes: usize) -> Self {
        let latent = Latent::from_seed(&model.prior(), 1);
        let latent = Latent { lobes: (0..lobes).map(|at| lobe(at, lobes)).collect(), ..latent };
        Self { name: name.into(), model, latent }
    }

    /// Floating-point operations of the folded network for one direction, and of the lobes but for their exponentials.
    pub(super) fn operations(&self) -> f64 {
        // an angle's cosine, the exponent, three channels
        let lobes = 7 * self.latent.lobes.len();
        2.0 * (multiply_adds(self.model.config()) + lobes) as f64
    }
}

/// One of `count` lobes on a spiral from pole to pole (Fibonacci's), as wide as those of fitted panoramas.
fn lobe(at: usize, count: usize) -> Lobe {
    let z = 1.0 - (2.0 * at as f32 + 1.0) / count as f32;
    let (sin, cos) = (at as f32 * std::f32::consts::PI * (3.0 - 5f32.sqrt())).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    Lobe { direction: [radius * cos, radius * sin, z], amplitude: [0.5; 3], sharpness: 40.0 }
}

/// The model that was named, or the one inside, and one by formula for each number of latent vectors.
pub(super) fn all(args: &ModelArgs, latent_vectors: &[usize], report: Report) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    match (source::model(args), &args.model) {
        (Ok(loaded), Some(path)) => {
            let name = path.file_name().map_or(loaded.name, |name| name.to_string_lossy().into_owned());
            cases.push(Case::new(name, loaded.model, loaded.lobes));
        }
        (Ok(loaded), None) => cases.push(Case::new("embedded", loaded.model, loaded.lobes)),
        (Err(error), Some(_)) => return Err(error),
        // a build without a model can still measure the others
        (Err(error), None) => report.note(format_args!("note: {error:#}")),
    }
    for n in latent_vectors {
        let model = Model::filler(&ModelConfig::decode_only(*n), 1)
            .map_err(|e| anyhow!("--latent-vectors {n}: {e}"))?;
        cases.push(Case::new("formula", model, 0));
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
