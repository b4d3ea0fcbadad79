//! The decoder: a neural field on the sphere conditioned on a latent, equivariant under SO(2) about z
//! and under reflections that keep z. MODEL (18).
//!
//! It is the RENI++ network with attention conditioning and Vector-Neuron invariance, folded: the
//! attention of the original has a single key, so what it adds is one vector per image and layer (see
//! [`Layer`]), and per direction there remains a residual MLP. The same fold serves training and use.
//!
//! [`DecoderConfig`] has the options with which it is compared: other ways to condition (FiLM, concat, attention over
//! [`Tokens`]), other invariants (Gram matrix) and other groups (SO(3), none).
//!
//! RENI (2022) is one of them. Its frame has y up, its first maps take their inputs in another order
//! (`reni_2022_inputs`): both are matters of import, not of the network.

mod condition;
mod import;
mod input;
mod invariants;
mod layer;
mod linear;
mod native;
mod output;
mod sine;
#[cfg(test)]
mod tests;
mod tokens;

pub use condition::Condition;
pub use import::reni_2022_inputs;
pub use layer::{Layer, Norm};
pub use linear::Linear;
pub use native::Native;
pub use tokens::{Memory, TokenLayer, Tokens};
use veni_light::random::Stream;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use veni_light::model::{Conditioning, DecoderConfig, Model};

use crate::Result;
use crate::vae::weights;

/// Latent and directions to log radiance.
#[derive(Module, Debug)]
pub struct Decoder {
    /// The Vector-Neuron invariants of the latent, if the network has them.
    pub condition: Option<Condition>,
    /// Token conditioning: invariants to tokens.
    pub tokens: Option<Tokens>,
    /// FiLM: the mapping network; otherwise empty.
    pub mapping: Vec<Linear>,
    /// The map of the directional input, [D, h]; for concat of all inputs, [D + C, h].
    pub input: Linear,
    /// What lies between input and output map.
    pub layers: Layers,
    /// The output map, [h, 3].
    pub output: Linear,
    #[module(skip)]
    config: DecoderConfig,
    latent_vectors: usize,
}

/// The layers of a decoder.
#[derive(Module, Debug)]
pub enum Layers {
    /// Residual perceptrons, each with the attention of one key.
    Attention(Vec<Layer>),
    /// Residual perceptrons, each with attention over the tokens.
    Tokens(Vec<TokenLayer>),
    /// The maps of sine layers: FiLM's or concat's.
    Sines(Vec<Linear>),
}

impl Decoder {
    /// The decoder of a model file.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) if the model's tensors are not those its configuration implies.
    pub fn from_model(model: &Model, device: &Device) -> Result<Self> {
        // every weight is replaced; the generator's only part is to give them a shape
        let mut rng = Stream::from_seed(0);
        let decoder = Self::new(&model.config().decoder, model.latent_vectors(), &mut rng, device);
        let tensors = model.tensors().iter().filter(|(name, _)| name.starts_with("decoder."));
        weights::write(decoder, "decoder", &tensors.map(|(name, t)| (name.clone(), t.clone())).collect())
    }

    /// A decoder for N = `latent_vectors` with weights drawn from `rng`: linear layers uniform in
    /// ±1/√inputs (sine layers as their authors say), norms at identity, the conditioning alive (see
    /// [`Condition::new`]).
    ///
    /// # Panics
    /// If `config` is inconsistent ([`ModelConfig::validate`](veni_light::model::ModelConfig::validate)).
    pub fn new(config: &DecoderConfig, latent_vectors: usize, rng: &mut Stream, device: &Device) -> Self {
        let (n, hidden, conditioning) = (latent_vectors, config.hidden, config.conditioning);
        let (directional, features) = (config.direction_inputs(n), config.condition_inputs(n));
        let condition = config.vn_channels().map(|c| Condition::new(config.vn_relu, c, rng, device));
        let tokens =
            (conditioning == Conditioning::Tokens).then(|| Tokens::new(n, features / n, hidden, rng, device));
        let mapping = match conditioning {
            Conditioning::Film => sine::mapping(config, n, rng, device),
            _ => Vec::new(),
        };
        let input = match conditioning {
            Conditioning::Attention | Conditioning::Tokens => Linear::new(directional, hidden, rng, device),
            Conditioning::Film => sine::first_map(directional, hidden, rng, device),
            Conditioning::Concat => sine::first_map(directional + features, hidden, rng, device),
        };
        let omega = sine::initial_omega(config);
        let count = 0..config.layers;
        let layers = match conditioning {
            Conditioning::Attention => {
                Layers::Attention(count.map(|_| Layer::new(features, hidden, rng, device)).collect())
            }
            Conditioning::Tokens => {
                Layers::Tokens(count.map(|_| TokenLayer::new(hidden, config.heads, rng, device)).collect())
            }
            Conditioning::Film | Conditioning::Concat => {
                Layers::Sines(count.map(|_| sine::hidden_map(omega, hidden, hidden, rng, device)).collect())
            }
        };
        let output = match layers {
            Layers::Sines(_) => sine::hidden_map(omega, hidden, 3, rng, device),
            Layers::Attention(_) | Layers::Tokens(_) => Linear::new(hidden, 3, rng, device),
        };
        let config = config.clone();
        Self { condition, tokens, mapping, input, layers, output, config, latent_vectors: n }
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.latent_vectors
    }

    /// What it was built from.
    pub fn config(&self) -> &DecoderConfig {
        &self.config
    }

    /// The device that holds the weights.
    pub fn device(&self) -> Device {
        self.output.bias.val().device()
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

    /// Latents [B, N, 3], directions [1 or B, R, 3] → [B, R, 3].
    fn decode(&self, latent: Tensor<3>, directions: Tensor<3>) -> Tensor<3> {
        let ([_, n, three], [_, _, coordinates]) = (latent.dims(), directions.dims());
        assert!(
            n == self.latent_vectors && three == 3 && coordinates == 3,
            "the decoder takes latents [B, {}, 3] and directions [.., 3], got {:?} and {:?}",
            self.latent_vectors,
            latent.dims(),
            directions.dims()
        );
        let basis = input::basis(directions);
        let products = input::products(self.config.equivariance, latent.clone());
        let (config, condition) = (&self.config, self.condition.as_ref());
        let (weight, bias) = (self.input.weight.val(), self.input.bias.val().unsqueeze::<2>());
        let features = |latent| invariants::vector(config, condition, latent);
        let y = match (&self.layers, &self.tokens) {
            (Layers::Attention(layers), _) => {
                let features = features(latent);
                let mut attention = layers.iter().map(|layer| layer.attention(features.clone()));
                let (first, rest) = layers.split_first().expect("a decoder has at least one layer");
                let offset = attention.next().expect("one per layer") + bias;
                let mut x = first.forward(input::project(weight, products, basis, offset));
                let mut previous = first;
                for (layer, attention) in rest.iter().zip(attention) {
                    x = layer.forward(previous.next_input(x, attention));
                    previous = layer;
                }
                previous.read_out(x, &self.output)
            }
            (Layers::Tokens(layers), Some(tokens)) => {
                let tokens = tokens.forward(invariants::tokens(config, condition, latent));
                let mut x = input::project(weight, products, basis, bias);
                for layer in layers {
                    x = layer.output(layer.forward(x, layer.remember(tokens.clone())));
                }
                self.output.forward(x)
            }
            (Layers::Tokens(_), None) => unreachable!("token layers come with tokens"),
            (Layers::Sines(layers), _) if config.conditioning == Conditioning::Film => {
                let x = input::project(weight, products, basis, bias);
                self.output.forward(sine::film(&self.mapping, features(latent), layers, x))
            }
            (Layers::Sines(layers), _) => {
                // what does not depend on the ray is an offset
                let features = features(latent);
                let (directional, width) = (config.direction_inputs(n), features.dims()[1]);
                let offset = features.matmul(weight.clone().narrow(0, directional, width)) + bias;
                let x = input::project(weight.narrow(0, 0, directional), products, basis, offset);
                self.output.forward(sine::siren(config.omega, layers, x))
            }
        };
        output::log_radiance(config, y)
    }
}

/// Z R for every latent vector z as a row, as the reference's field does before decoding:
/// latents [B, N, 3], matrix [3, 3] → [B, N, 3].
pub fn rotate(latent: Tensor<3>, rotation: Tensor<2>) -> Tensor<3> {
    latent.matmul(rotation.unsqueeze())
}
