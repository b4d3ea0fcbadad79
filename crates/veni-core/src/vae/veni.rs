//! Encoder and decoder together: the variational auto-encoder.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use veni_light::random::Stream;

use super::weights::{self, Weights};
use super::{Decoder, Encoder};
use crate::{Error, Result};
use veni_light::model::{Model, ModelConfig, ModelInfo};
use veni_light::sphere::{Equirect, Stripes};

/// Images that go through the network together outside of training; bounds the memory.
const CHUNK: usize = 8;

/// The variational auto-encoder. Parameter paths start with `decoder.` and `encoder.`.
#[derive(Module, Debug)]
pub struct Veni {
    /// Panorama to posterior over latents.
    pub encoder: Encoder,
    /// Latent and directions to log radiance.
    pub decoder: Decoder,
}

/// What the encoder says about one panorama.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoded {
    /// The means of the N latent vectors.
    pub vectors: Vec<[f32; 3]>,
    /// Their variances per coordinate; absent where none are predicted.
    pub variances: Option<Vec<f32>>,
}

impl Veni {
    /// A network with weights drawn from `rng`, decoder first.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `config` is inconsistent or describes no encoder.
    pub fn new(config: &ModelConfig, rng: &mut Stream, device: &Device) -> Result<Self> {
        config.validate()?;
        let encoder = config.encoder.as_ref();
        let encoder =
            encoder.ok_or_else(|| Error::invalid("the model has no encoder: it can only decode"))?;
        let decoder = Decoder::new(&config.decoder, config.latent_vectors, rng, device);
        Ok(Self { encoder: Encoder::new(encoder, config.latent_vectors, rng, device)?, decoder })
    }

    /// The network of a model file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the file has no encoder, or its tensors are not those its configuration implies.
    pub fn from_model(model: &Model, device: &Device) -> Result<Self> {
        // every weight is replaced; the generator's only part is to give them a shape
        let mut rng = Stream::from_seed(0);
        let veni = Self::new(model.config(), &mut rng, device)?;
        let tensors = model.tensors().iter().filter(|(name, _)| !name.starts_with("prior."));
        weights::write(veni, "", &tensors.map(|(name, t)| (name.clone(), t.clone())).collect())
    }

    /// The model file's content, without a prior.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a weight is not finite.
    pub fn to_model(&self, config: &ModelConfig, info: ModelInfo) -> Result<Model> {
        model_of(weights::read(self, ""), config, info)
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.decoder.latent_vectors()
    }

    /// Where the encoder looks. Where every sample is a token, there is one meridian per stripe.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the configured numbers of stripes and samples cannot be laid out.
    pub fn stripes(&self) -> Result<Stripes> {
        let config = &self.encoder.config;
        Stripes::new(config.stripes, config.samples.unwrap_or(config.stripes / 2), config.sampling)
    }

    /// Encodes panoramas: log radiance at exposure 0 on `grid`, 3·W·H values each.
    ///
    /// # Errors
    /// As [`Veni::stripes`].
    ///
    /// # Panics
    /// If an image has another size.
    pub fn encode(&self, grid: Equirect, images: &[&[f32]]) -> Result<Vec<Encoded>> {
        let stripes = self.stripes()?;
        let gather = stripes.gather(grid);
        let device = self.device();
        let size = [stripes.stripes(), stripes.samples(), 3];
        let directions = stripes.directions().into_flattened();
        let directions = Tensor::<3>::from_data(TensorData::new(directions, size), &device);
        let mut out = Vec::with_capacity(images.len());
        for chunk in images.chunks(CHUNK) {
            let samples: Vec<f32> =
                chunk.iter().flat_map(|image| gather.sample(image.as_chunks().0)).flatten().collect();
            let samples = TensorData::new(samples, [chunk.len(), size[0], size[1], 3]);
            let posterior = self.encoder.forward(directions.clone(), Tensor::from_data(samples, &device));
            let n = self.latent_vectors();
            let means = values(posterior.mean);
            let variances = posterior.log_variance.map(|l| values(l.exp()));
            for (b, mean) in means.chunks_exact(3 * n).enumerate() {
                out.push(Encoded {
                    vectors: mean.as_chunks().0.to_vec(),
                    variances: variances.as_ref().map(|v| v[b * n..][..n].to_vec()),
                });
            }
        }
        Ok(out)
    }

    /// Decodes latents on every pixel of `grid`: log radiance at exposure 0, 3·W·H values each.
    ///
    /// # Panics
    /// If a latent does not have N vectors.
    pub fn decode(&self, grid: Equirect, latents: &[Vec<[f32; 3]>]) -> Vec<Vec<f32>> {
        decode(&self.decoder, grid, latents)
    }

    /// The device that holds the weights.
    pub fn device(&self) -> Device {
        self.decoder.device()
    }
}

/// [`Veni::decode`] for a decoder alone.
///
/// # Panics
/// If a latent does not have N vectors.
pub fn decode(decoder: &Decoder, grid: Equirect, latents: &[Vec<[f32; 3]>]) -> Vec<Vec<f32>> {
    let device = decoder.device();
    let n = decoder.latent_vectors();
    let directions = TensorData::new(grid.directions().into_flattened(), [grid.len(), 3]);
    let directions = Tensor::<2>::from_data(directions, &device);
    let mut out = Vec::with_capacity(latents.len());
    for chunk in latents.chunks(CHUNK) {
        let flat: Vec<f32> = chunk.iter().flat_map(|l| l.as_flattened()).copied().collect();
        let latent = Tensor::<3>::from_data(TensorData::new(flat, [chunk.len(), n, 3]), &device);
        let decoded = values(decoder.forward(latent, directions.clone()));
        out.extend(decoded.chunks_exact(3 * grid.len()).map(<[f32]>::to_vec));
    }
    out
}

/// Weights by dotted path as a checked model.
///
/// # Errors
/// [`Error::Invalid`] as [`Model::new`].
pub fn model_of(weights: Weights, config: &ModelConfig, info: ModelInfo) -> Result<Model> {
    Model::new(config.clone(), weights, info)
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().convert::<f32>().try_into_vec().expect("just converted to f32")
}
