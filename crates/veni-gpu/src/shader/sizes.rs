//! What the shaders are specialised on.

use veni_light::model::ModelConfig;

use super::MAX_LIGHTS;

/// Most lobes of a latent.
pub const MAX_LOBES: usize = 64;

/// Sizes of a decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sizes {
    /// N, vectors of a latent.
    pub latents: usize,
    /// h, width of the residual perceptron.
    pub hidden: usize,
    /// Residual layers.
    pub layers: usize,
}

impl From<&ModelConfig> for Sizes {
    fn from(config: &ModelConfig) -> Self {
        let decoder = &config.decoder;
        Self { latents: config.latent_vectors, hidden: decoder.hidden, layers: decoder.layers }
    }
}

impl Sizes {
    /// vec4s in a row of hidden features, padded to whole groups of eight features.
    pub fn columns(self) -> usize {
        2 * self.hidden.div_ceil(8)
    }

    /// Directional inputs padded to whole fours.
    pub fn padded_inputs(self) -> usize {
        (self.latents + 2).next_multiple_of(4)
    }

    /// Rows of the matrix buffer.
    pub fn matrix_rows(self) -> usize {
        5 * self.padded_inputs() + 2 * self.layers * 4 * self.columns()
    }

    /// Rows of the vector buffer.
    pub fn vector_rows(self) -> usize {
        5 * self.layers + 4
    }

    /// vec4s of one latent's block.
    pub fn latent_stride(self) -> usize {
        self.columns() * (self.layers + 1) + self.latents + 1 + 2 * (MAX_LIGHTS + MAX_LOBES)
    }

    /// Multiply-adds of the folded network for one direction (padding not counted).
    pub fn multiply_adds(self) -> usize {
        5 * (self.latents + 2) * self.hidden + 2 * self.layers * self.hidden * self.hidden + 3 * self.hidden
    }
}
