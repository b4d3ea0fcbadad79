//! The shader stages on the CPU, under the same names and in the same order, on the same packed buffers: the decoder in double
//! precision, the light's functions in single. Slow and plain: for comparing a GPU's stages one by one, and as the truth in
//! tests.

mod compact;
mod directions;
mod encode;
mod field;
mod glints;
mod light;
mod lights_grid;
mod output;
mod spectrum;

pub use directions::{direction_of, listed};
pub use encode::{veni_encode, veni_sin_cos};
pub use glints::veni_glints;
pub use light::{LightTwin, VeniLightSample};
pub use lights_grid::gained;
pub use output::stored;
pub use spectrum::{veni_degrees, veni_harmonics};

use super::{PackedModel, Sizes};

/// The buffers that the stages read.
#[derive(Clone, Debug)]
pub struct Twin {
    /// What they are laid out for.
    pub sizes: Sizes,
    /// `veni_matrices`.
    pub matrices: Vec<f32>,
    /// `veni_vectors`.
    pub vectors: Vec<f32>,
    /// `veni_latents`.
    pub latents: Vec<f32>,
}

impl Twin {
    /// A twin of a packed model and packed latents.
    pub fn new(model: PackedModel, latents: Vec<f32>) -> Self {
        Self { sizes: model.sizes, matrices: model.matrices.0, vectors: model.vectors, latents }
    }

    fn row(&self) -> usize {
        4 * self.sizes.columns()
    }

    /// One of the five vectors of a layer, in the order γ₁ β₁ b₁ b₂ γ₂.
    fn vector(&self, layer: usize, which: usize) -> &[f32] {
        &self.vectors[(5 * layer + which) * self.row()..][..self.sizes.hidden]
    }

    /// Block of a latent.
    fn latent(&self, index: usize) -> &[f32] {
        let stride = 4 * self.sizes.latent_stride();
        &self.latents[index * stride..][..stride]
    }
}
