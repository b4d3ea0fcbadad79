//! The auto-decoder RENI++: a decoder, and a latent for every training panorama. MODEL (25).

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor};
use veni_light::random::Stream;

use super::decoder::Condition;
use super::{Decoder, weights};
use crate::nn::normal;
use crate::{Error, Result};
use veni_light::model::{Model, ModelConfig, ModelInfo};

/// Decoder and latent table. Parameter paths start with `decoder.` and `latents.`.
#[derive(Module, Debug)]
pub struct Reni {
    /// Latent and directions to log radiance.
    pub decoder: Decoder,
    /// The latents of the training panoramas.
    pub latents: LatentTable,
}

/// A Gaussian over the latent of each of n panoramas, with a variance for every coordinate.
#[derive(Module, Debug)]
pub struct LatentTable {
    /// μ [n, N, 3].
    pub mean: Param<Tensor<3>>,
    /// ln σ² [n, N, 3].
    pub log_variance: Param<Tensor<3>>,
    /// Added to each panorama's decoded log radiance, `[n]`; absent: nothing is.
    pub scale: Option<Param<Tensor<1>>>,
}

/// The rows of a table for a batch.
#[derive(Clone, Debug)]
pub struct TableRows {
    /// μ [B, N, 3].
    pub mean: Tensor<3>,
    /// ln σ² [B, N, 3].
    pub log_variance: Tensor<3>,
    /// Added to log radiance, [B, 1, 1].
    pub scale: Option<Tensor<3>>,
}

impl LatentTable {
    /// For n `panoramas` and N = `latent_vectors`: μ ~ N(0, 1), ln σ² ~ N(−5, 1), and 0 for every scale if there are.
    pub fn new(
        panoramas: usize,
        latent_vectors: usize,
        free_exposure: bool,
        rng: &mut Stream,
        device: &Device,
    ) -> Self {
        let shape = [panoramas, latent_vectors, 3];
        Self {
            mean: normal(shape, [0.0, 1.0], rng, device),
            log_variance: normal(shape, [-5.0, 1.0], rng, device),
            scale: free_exposure.then(|| Param::from_tensor(Tensor::zeros([panoramas], device))),
        }
    }

    /// n, the number of panoramas.
    pub fn panoramas(&self) -> usize {
        self.mean.dims()[0]
    }

    /// The rows of some panoramas.
    ///
    /// # Panics
    /// If one is not below n.
    pub fn rows(&self, panoramas: &[usize]) -> TableRows {
        let device = self.mean.val().device();
        let indices: Vec<i32> = panoramas.iter().map(|i| *i as i32).collect();
        let indices = Tensor::<1, Int>::from_ints(indices.as_slice(), &device);
        let scale = self.scale.as_ref().map(|scale| scale.val().select(0, indices.clone()));
        TableRows {
            mean: self.mean.val().select(0, indices.clone()),
            log_variance: self.log_variance.val().select(0, indices),
            scale: scale.map(|scale| scale.reshape([panoramas.len(), 1, 1])),
        }
    }
}

impl TableRows {
    /// μ + σ ε for `noise` ε [B, N, 3].
    pub fn sample(&self, noise: Tensor<3>) -> Tensor<3> {
        self.mean.clone() + (self.log_variance.clone() * 0.5).exp() * noise
    }
}

impl Reni {
    /// A network with weights drawn from `rng`, decoder first, for n = `panoramas`. As in RENI++, the Vector-Neuron
    /// weights start from N(0, 1).
    ///
    /// # Errors
    /// [`Error::Invalid`] if `config` is inconsistent or describes an encoder.
    pub fn new(
        config: &ModelConfig,
        panoramas: usize,
        free_exposure: bool,
        rng: &mut Stream,
        device: &Device,
    ) -> Result<Self> {
        config.validate()?;
        if config.encoder.is_some() {
            return Err(Error::invalid("model.encoder: an auto-decoder has none"));
        }
        let (n, decoder) = (config.latent_vectors, &config.decoder);
        let mut network = Decoder::new(decoder, n, rng, device);
        network.condition =
            decoder.vn_channels().map(|c| Condition::standard_normal(decoder.vn_relu, c, rng, device));
        Ok(Self { decoder: network, latents: LatentTable::new(panoramas, n, free_exposure, rng, device) })
    }

    /// The model file's content: the decoder, without a prior. The table is not part of it.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a weight is not finite.
    pub fn to_model(&self, config: &ModelConfig, info: ModelInfo) -> Result<Model> {
        super::veni::model_of(weights::read(&self.decoder, "decoder"), config, info)
    }
}
