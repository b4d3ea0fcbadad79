//! The decoder: a neural field on the sphere conditioned on a latent, equivariant under SO(2) about z
//! and under reflections that keep z.
//!
//! It is the RENI++ network with attention conditioning and Vector-Neuron invariance, folded: the
//! attention of the original has a single key, so what it adds is one vector per image and layer (see
//! [`Layer`]), and per direction there remains a residual MLP. The same fold serves training and use.

mod condition;
mod input;
mod layer;
mod linear;
#[cfg(test)]
mod tests;

pub use condition::Condition;
pub use layer::{Layer, Norm};
pub use linear::Linear;

use crate::model::DecoderConfig;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// Latent and directions to log radiance.
#[derive(Module, Debug)]
pub struct Decoder {
    /// The invariant part of the latent.
    pub condition: Condition,
    /// Encoded directional input, [5(N + 2), h].
    pub input: Linear,
    /// The residual layers.
    pub layers: Vec<Layer>,
    /// Log radiance, [h, 3].
    pub output: Linear,
}

impl Decoder {
    /// A decoder for N = `latent_vectors` with weights drawn from `rng`: linear layers uniform in
    /// ±1/√inputs, norms at identity, the conditioning alive (see [`Condition::new`]).
    pub fn new(config: &DecoderConfig, latent_vectors: usize, rng: &mut impl Rng, device: &Device) -> Self {
        let (n, hidden) = (latent_vectors, config.hidden);
        Self {
            condition: Condition::new(config.vn_relu, rng, device),
            input: Linear::new(5 * (n + 2), hidden, rng, device),
            layers: (0..config.layers).map(|_| Layer::new(3 * n, hidden, rng, device)).collect(),
            output: Linear::new(hidden, 3, rng, device),
        }
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.input.weight.dims()[0] / 5 - 2
    }

    /// Log radiance of every image in the same directions: latents [B, N, 3], unit directions [R, 3] →
    /// [B, R, 3] (r, g, b). Differentiable in the latents and the weights, also at latent 0; directions
    /// are constants.
    ///
    /// # Panics
    /// If a shape is none of these.
    pub fn forward(&self, latent: Tensor<3>, directions: Tensor<2>) -> Tensor<3> {
        self.decode(latent, directions.unsqueeze())
    }

    /// [`forward`](Self::forward) with each image's own directions, [B, R, 3].
    ///
    /// # Panics
    /// If a shape is none of these.
    pub fn forward_per_image(&self, latent: Tensor<3>, directions: Tensor<3>) -> Tensor<3> {
        assert_eq!(
            latent.dims()[0],
            directions.dims()[0],
            "latents {:?} and directions {:?} must be of the same number of images",
            latent.dims(),
            directions.dims()
        );
        self.decode(latent, directions)
    }

    fn decode(&self, latent: Tensor<3>, directions: Tensor<3>) -> Tensor<3> {
        let condition = self.condition.forward(latent.clone());
        self.forward_conditioned(latent, condition, directions)
    }

    /// The network alone, for a conditioning vector computed by the caller: latents [B, N, 3], whatever
    /// the layers' value maps take [B, C], directions [1 or B, R, 3] → [B, R, 3].
    ///
    /// # Panics
    /// If a shape is none of these.
    pub fn forward_conditioned(
        &self,
        latent: Tensor<3>,
        condition: Tensor<2>,
        directions: Tensor<3>,
    ) -> Tensor<3> {
        let ([_, n, three], [_, _, coordinates]) = (latent.dims(), directions.dims());
        assert!(
            n == self.latent_vectors() && three == 3 && coordinates == 3,
            "the decoder takes latents [B, {}, 3] and directions [.., 3], got {:?} and {:?}",
            self.latent_vectors(),
            latent.dims(),
            directions.dims()
        );
        let mut attention = self.layers.iter().map(|layer| layer.attention(condition.clone()));
        let (first, rest) = self.layers.split_first().expect("a decoder has at least one layer");
        let offset = attention.next().expect("one per layer");
        let mut x = first.forward(input::encode(&self.input, latent, input::basis(directions), offset));
        let mut previous = first;
        for (layer, attention) in rest.iter().zip(attention) {
            x = layer.forward(previous.next_input(x, attention));
            previous = layer;
        }
        previous.read_out(x, &self.output)
    }
}

/// Z R for every latent vector z as a row, as the authors' field does before decoding:
/// latents [B, N, 3], matrix [3, 3] → [B, N, 3].
pub fn rotate(latent: Tensor<3>, rotation: Tensor<2>) -> Tensor<3> {
    latent.matmul(rotation.unsqueeze())
}
