//! VN-ViT, the rotation-equivariant encoder: a panorama seen as vertical stripes, one token each. MODEL (13, 14).

use super::Posterior;
use crate::nn::{
    FoldedGates, VectorLinear, VectorLinearConfig, VectorTransformer, VectorTransformerConfig,
    coordinate_norm,
};
use crate::{Error, Result};
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use veni_light::model::{EncoderConfig, Pooling, Reduction, VectorLayer};
use veni_light::random::Stream;

/// x, y, z and the colours r, g, b of one sample.
const SAMPLE_COORDINATES: usize = 6;
/// x, y, z.
const LATENT_COORDINATES: usize = 3;

/// From directions and log radiance to a [`Posterior`] over latents.
///
/// 1. A stripe of P samples becomes a token of P channels with coordinates (x, y, z, r, g, b).
/// 2. `project_in` maps samples to channels.
/// 3. A class token joins in front: zero in x, y; learned in the invariant coordinates, initially zero.
/// 4. The transformer; then the class token (or the mean over tokens) is read:
/// 5. `project_out` gives μ; `project_log_variance` gives vectors w with ln σ² = |w_xy| + w_z.
///
/// Rotating all directions about z rotates the latent by the same angle; the order of stripes does not matter.
/// Hence a panorama rolled by whole stripes, sampled on the same grid, gives the rotated latent exactly.
#[derive(Module, Debug)]
pub struct Encoder {
    /// Samples to channels.
    pub project_in: VectorLinear,
    /// Invariant coordinates of the class token, `[invariant coordinates, channels]`.
    pub cls: Option<Param<Tensor<2>>>,
    /// Blocks over tokens.
    pub transformer: VectorTransformer,
    /// Channels to the means of N latent vectors.
    pub project_out: VectorLinear,
    /// Channels to N vectors whose invariants are log variances.
    pub project_log_variance: Option<VectorLinear>,
    /// What it was built from.
    #[module(skip)]
    pub config: EncoderConfig,
}

/// An [`Encoder`] whose weights no longer change, with its products of weights computed once.
#[derive(Clone, Debug)]
pub struct FoldedEncoder {
    encoder: Encoder,
    gates: FoldedGates,
}

impl Encoder {
    /// Draws the weights from `rng`.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a size is zero or a Vector-Neuron layer is asked to change the number of
    /// coordinates.
    pub fn new(
        config: &EncoderConfig,
        latent_vectors: usize,
        rng: &mut Stream,
        device: &Device,
    ) -> Result<Self> {
        check(config, latent_vectors)?;
        let inner = inner_coordinates(config);
        let channels = config.channels;
        let project_in = VectorLinearConfig {
            layer: config.project_in,
            input: config.samples.unwrap_or(1),
            output: channels,
            coordinates_in: SAMPLE_COORDINATES,
            coordinates_out: inner,
        };
        let transformer = VectorTransformerConfig {
            layer: config.transformer,
            depth: config.depth,
            channels,
            heads: config.heads,
            head_channels: config.head_channels,
            expansion: config.feedforward,
            coordinates: inner,
            form: config.vn_relu,
            final_norm: false,
        };
        let project_out = VectorLinearConfig {
            layer: config.project_out,
            input: channels,
            output: latent_vectors,
            coordinates_in: inner,
            coordinates_out: match config.reduction {
                Reduction::LateSplit => inner,
                Reduction::EarlyLearned | Reduction::LateLearned => LATENT_COORDINATES,
            },
        };
        let learned_cls = config.pooling == Pooling::Cls && config.learnable_cls;
        Ok(Self {
            project_in: project_in.init(rng, device),
            cls: learned_cls.then(|| Param::from_tensor(Tensor::zeros([inner - 2, channels], device))),
            transformer: transformer.init(rng, device),
            project_out: project_out.init(rng, device),
            project_log_variance: config.variational.then(|| project_out.init(rng, device)),
            config: config.clone(),
        })
    }

    /// Encodes images that were all looked up along the same directions.
    ///
    /// # Shapes
    /// - `directions`: unit vectors in the native frame, `[stripes, samples, 3]`
    /// - `log_radiance`: natural logarithm, `[batch, stripes, samples, 3]`
    /// - output: `[batch, N, 3]` and `[batch, N, 1]`
    pub fn forward(&self, directions: Tensor<3>, log_radiance: Tensor<4>) -> Posterior {
        self.forward_per_image(shared(directions, &log_radiance), log_radiance)
    }

    /// Encodes images with directions of their own.
    ///
    /// # Shapes
    /// - `directions`: unit vectors in the native frame, `[batch, stripes, samples, 3]`
    /// - `log_radiance`: natural logarithm, `[batch, stripes, samples, 3]`
    /// - output: `[batch, N, 3]` and `[batch, N, 1]`
    pub fn forward_per_image(&self, directions: Tensor<4>, log_radiance: Tensor<4>) -> Posterior {
        self.run(directions, log_radiance, None)
    }

    /// For inference: computes the products of weights once. Needs half again the memory of the feed-forwards.
    pub fn fold(self) -> FoldedEncoder {
        let gates = self.transformer.fold();
        FoldedEncoder { encoder: self, gates }
    }

    /// The encoder that gives for directions −d the very numbers that this one gives for d: for weights that were
    /// trained on the opposite directions. Only the first layer is rewritten.
    ///
    /// # Errors
    /// [`Error::Unsupported`] where `project_in` is a Vector-Neuron layer: there the colours share the weights of
    /// the directions and keep their sign.
    pub fn for_negated_directions(self) -> Result<Self> {
        let VectorLinear::So2(project_in) = self.project_in else {
            return Err(Error::unsupported(
                "encoder: a Vector-Neuron project_in cannot be rewritten for negated directions; negate the \
                 directions it is given",
            ));
        };
        let channels = self.config.samples.unwrap_or(1);
        let project_in = VectorLinear::So2(project_in.for_negated_directions(channels));
        Ok(Self { project_in, ..self })
    }

    fn run(&self, directions: Tensor<4>, log_radiance: Tensor<4>, gates: Option<&FoldedGates>) -> Posterior {
        let tokens = self.project_in.forward(self.samples_as_channels(directions, log_radiance));
        let token = match self.config.pooling {
            Pooling::Cls => self.transformer.run(self.prepend_cls(tokens), true, gates),
            Pooling::Mean => self.transformer.run(tokens, false, gates).mean_dim(1),
        };
        let log_variance = self.project_log_variance.as_ref().map(|project| {
            let w = project.forward(token.clone());
            let radius = coordinate_norm(w.clone().narrow(2, 0, 2));
            vectors(radius + w.narrow(2, 2, 1))
        });
        let mean = vectors(self.project_out.forward(token).narrow(2, 0, LATENT_COORDINATES));
        Posterior { mean, log_variance }
    }

    /// `[batch, stripe, sample, 3]` twice to `[batch, token, 6, channel]`.
    fn samples_as_channels(&self, directions: Tensor<4>, log_radiance: Tensor<4>) -> Tensor<4> {
        let [batch, stripes, samples, _] = log_radiance.dims();
        assert_eq!(directions.dims(), log_radiance.dims(), "directions and log radiance differ in shape");
        match self.config.samples {
            Some(expected) => {
                assert_eq!(samples, expected, "a stripe has {samples} samples, the encoder takes {expected}");
                Tensor::cat(vec![directions.swap_dims(2, 3), log_radiance.swap_dims(2, 3)], 2)
            }
            None => Tensor::cat(vec![directions, log_radiance], 3).reshape([
                batch,
                stripes * samples,
                SAMPLE_COORDINATES,
                1,
            ]),
        }
    }

    /// Puts the class token first.
    fn prepend_cls(&self, tokens: Tensor<4>) -> Tensor<4> {
        let [batch, _, coordinates, channels] = tokens.dims();
        let options = (&tokens.device(), tokens.dtype());
        let cls = match &self.cls {
            Some(invariant) => {
                let invariant = invariant.val().reshape([1, 1, coordinates - 2, channels]);
                let equivariant = Tensor::zeros([batch, 1, 2, channels], options);
                Tensor::cat(vec![equivariant, invariant.expand([batch, 1, coordinates - 2, channels])], 2)
            }
            None => Tensor::zeros([batch, 1, coordinates, channels], options),
        };
        Tensor::cat(vec![cls, tokens], 1)
    }
}

impl FoldedEncoder {
    /// As [`Encoder::forward`].
    pub fn forward(&self, directions: Tensor<3>, log_radiance: Tensor<4>) -> Posterior {
        self.forward_per_image(shared(directions, &log_radiance), log_radiance)
    }

    /// As [`Encoder::forward_per_image`].
    pub fn forward_per_image(&self, directions: Tensor<4>, log_radiance: Tensor<4>) -> Posterior {
        self.encoder.run(directions, log_radiance, Some(&self.gates))
    }
}

/// The same directions for every image.
fn shared(directions: Tensor<3>, log_radiance: &Tensor<4>) -> Tensor<4> {
    let [stripes, samples, coordinates] = directions.dims();
    let batch = log_radiance.dims()[0];
    directions.unsqueeze::<4>().expand([batch, stripes, samples, coordinates])
}

/// `[batch, 1, coordinate, N]` to `[batch, N, coordinate]`.
fn vectors(x: Tensor<4>) -> Tensor<3> {
    x.squeeze_dim::<3>(1).swap_dims(1, 2)
}

/// Coordinates inside the transformer.
fn inner_coordinates(config: &EncoderConfig) -> usize {
    match config.reduction {
        Reduction::EarlyLearned => LATENT_COORDINATES,
        Reduction::LateSplit | Reduction::LateLearned => SAMPLE_COORDINATES,
    }
}

/// Refuses what cannot be built.
fn check(config: &EncoderConfig, latent_vectors: usize) -> Result<()> {
    let EncoderConfig { channels, heads, head_channels, feedforward, .. } = *config;
    let sizes = [
        ("latent_vectors", latent_vectors),
        ("samples", config.samples.unwrap_or(1)),
        ("channels", channels),
        ("heads", heads),
        ("head_channels", head_channels),
        ("feedforward", feedforward),
    ];
    for (name, size) in sizes {
        if size == 0 {
            return Err(Error::invalid(format!("encoder: {name} is 0, it must be at least 1")));
        }
    }
    let refuse = |layer: &str, reduction: &str| {
        Err(Error::invalid(format!(
            "encoder: {layer} = \"vn\" cannot change the number of coordinates, which reduction = \"{reduction}\" asks \
             of it; use {layer} = \"so2\" or reduction = \"late-split\""
        )))
    };
    match config.reduction {
        Reduction::EarlyLearned if config.project_in == VectorLayer::Vn => {
            refuse("project_in", "early-learned")
        }
        Reduction::LateLearned if config.project_out == VectorLayer::Vn => {
            refuse("project_out", "late-learned")
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
#[path = "encoder_tests.rs"]
mod tests;
