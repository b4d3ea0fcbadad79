//! Encoder and decoder together: the variational auto-encoder.

use burn::module::Module;
use burn::tensor::Device;
use rand::Rng;

use super::{Decoder, Encoder};
use crate::model::ModelConfig;
use crate::{Error, Result};

/// The variational auto-encoder. Parameter paths start with `decoder.` and `encoder.`.
#[derive(Module, Debug)]
pub struct Veni {
    /// Panorama to posterior over latents.
    pub encoder: Encoder,
    /// Latent and directions to log radiance.
    pub decoder: Decoder,
}

impl Veni {
    /// A network with weights drawn from `rng`, decoder first.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `config` is inconsistent or describes no encoder.
    pub fn new(config: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Result<Self> {
        config.validate()?;
        let encoder = config.encoder.as_ref();
        let encoder = encoder.ok_or_else(|| Error::invalid("the model has no encoder: it can only decode"))?;
        let decoder = Decoder::new(&config.decoder, config.latent_vectors, rng, device);
        Ok(Self { encoder: Encoder::new(encoder, config.latent_vectors, rng, device)?, decoder })
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.decoder.latent_vectors()
    }
}
