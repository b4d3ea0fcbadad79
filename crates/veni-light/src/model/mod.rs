//! The model: its configuration and its weight file, the bridge between training and use.
//!
//! The file is safetensors. Tensors are f32 or f16, named by dotted path: `decoder.*` (exactly
//! [`decoder_schema`]), `encoder.*` (optional; checked by veni-core, carried as it is here) and
//! `prior.*` (optional; see [`Model::prior`]). The header entry `veni` is JSON: `format`, `kind`, `config`
//! ([`ModelConfig`]), `frame` (always `z-up`) and provenance ([`ModelInfo`]).
//!
//! A [`Model`] in memory has passed all checks, so what is built from it cannot fail.

mod config;
mod decoder;
mod file;
mod filler;
mod half;
mod header;
#[cfg(feature = "pretrained")]
mod pretrained;
mod prior;
mod prior_sun;
mod schema;

use std::collections::BTreeMap;

pub use config::{EncoderConfig, ModelConfig, ModelKind, Pooling, Reduction, VectorLayer, VnReluForm};
pub use decoder::{Conditioning, DecoderConfig, Encoding, Equivariance, Invariance, OutputForm};
pub use file::{MAX_FILE_BYTES, StoredType};
pub use header::{FORMAT, ModelInfo, Training};
pub use schema::decoder_schema;
pub use schema::mapping_sizes;

use crate::digest::Digest;
use crate::{Error, Result};

/// A named tensor's content, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Sizes, slowest first; their product is the number of values.
    pub shape: Vec<usize>,
    /// Values; all finite once inside a [`Model`].
    pub data: Vec<f32>,
}

/// A checked set of weights with its configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    config: ModelConfig,
    tensors: BTreeMap<String, Array>,
    info: ModelInfo,
}

impl Model {
    /// Checks the configuration and the tensors and puts them together.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a decoder tensor is missing, unexpected or has the wrong shape (both are named),
    /// if an encoder is there that the configuration does not describe, if the prior is malformed, or if a
    /// value is not finite.
    pub fn new(config: ModelConfig, tensors: BTreeMap<String, Array>, info: ModelInfo) -> Result<Self> {
        config.validate()?;
        let schema: BTreeMap<_, _> = decoder_schema(&config).into_iter().collect();
        for (name, shape) in &schema {
            let Some(tensor) = tensors.get(name) else {
                return Err(Error::invalid(format!("tensor {name} {shape:?} is missing")));
            };
            if tensor.shape != *shape {
                let found = &tensor.shape;
                return Err(Error::invalid(format!(
                    "tensor {name} is {found:?}, the configuration says {shape:?}"
                )));
            }
        }
        for (name, tensor) in &tensors {
            let known = schema.contains_key(name)
                || name.starts_with("prior.")
                || name.starts_with("encoder.") && config.encoder.is_some();
            if !known {
                let shape = &tensor.shape;
                return Err(Error::invalid(format!("tensor {name} {shape:?} is unexpected in this model")));
            }
            if tensor.shape.iter().try_fold(1usize, |n, d| n.checked_mul(*d)) != Some(tensor.data.len()) {
                let (shape, count) = (&tensor.shape, tensor.data.len());
                return Err(Error::invalid(format!("tensor {name} {shape:?} has {count} values")));
            }
            if let Some((at, value)) = tensor.data.iter().enumerate().find(|(_, v)| !v.is_finite()) {
                return Err(Error::invalid(format!("tensor {name}: value {at} is {value}")));
            }
        }
        prior::check(&tensors, config.latent_vectors)?;
        Ok(Self { config, tensors, info })
    }

    /// The hyper-parameters.
    pub fn config(&self) -> &ModelConfig {
        &self.config
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.config.latent_vectors
    }

    /// Where the weights come from.
    pub fn info(&self) -> &ModelInfo {
        &self.info
    }

    /// Replaces the provenance; nothing that is computed changes.
    pub fn set_info(&mut self, info: ModelInfo) {
        self.info = info;
    }

    /// All tensors by name, in alphabetical order.
    pub fn tensors(&self) -> &BTreeMap<String, Array> {
        &self.tensors
    }

    /// One tensor by its full name, e.g. `decoder.output.bias`.
    pub fn tensor(&self, name: &str) -> Option<&Array> {
        self.tensors.get(name)
    }

    /// Whether there are encoder weights; a model without them only decodes.
    pub fn has_encoder(&self) -> bool {
        self.tensors.keys().any(|name| name.starts_with("encoder."))
    }

    /// The same decoder and prior without the encoder.
    #[must_use]
    pub fn without_encoder(mut self) -> Self {
        self.tensors.retain(|name, _| !name.starts_with("encoder."));
        self.config.encoder = None;
        self
    }

    /// Identity of the decoder: 16 hexadecimal digits. A latent carries it, because a code means something
    /// only to the decoder it was made for.
    ///
    /// The text of the [`Digest`] of, one after the other: the JSON of `[latent_vectors, decoder config]`,
    /// then for every decoder tensor in alphabetical order its name, a zero byte, and its values rounded to
    /// half precision, little endian. Encoder, prior and provenance do not enter, and neither does the stored
    /// type: stripping the encoder or storing f16 leaves existing latents valid.
    pub fn hash(&self) -> String {
        let sizes = (self.config.latent_vectors, &self.config.decoder);
        let head = Digest::build().update(serde_json::to_vec(&sizes).unwrap_or_default());
        let decoder = self.tensors.iter().filter(|(name, _)| name.starts_with("decoder."));
        let all = decoder.fold(head, |digest, (name, tensor)| {
            let halves = tensor.data.iter().flat_map(|v| half::from_f32(*v).to_le_bytes());
            digest.update(name).update([0]).update(halves.collect::<Vec<u8>>())
        });
        all.finish().to_string()
    }

    /// Identity of all weights, encoder and prior included: the digest of the JSON of the configuration, then for every
    /// tensor in alphabetical order its name, a zero byte, and its values as f32, little endian. Provenance is left out.
    pub fn digest(&self) -> Digest {
        let head = Digest::build().update(serde_json::to_vec(&self.config).unwrap_or_default());
        let all = self.tensors.iter().fold(head, |digest, (name, tensor)| {
            let values = tensor.data.iter().flat_map(|v| v.to_le_bytes());
            digest.update(name).update([0]).update(values.collect::<Vec<u8>>())
        });
        all.finish()
    }
}

#[cfg(test)]
mod tests;
