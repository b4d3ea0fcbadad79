//! Hyper-parameters of a model, as stored in its file and in a run's `config.toml`.

use serde::{Deserialize, Serialize};

use super::{Conditioning, DecoderConfig};
use crate::compact::Lights;
use crate::limits::{
    MAX_CONDITION_FEATURES, MAX_ENCODER_NUMBERS, MAX_ENCODER_SAMPLES, MAX_TOKEN_NUMBERS, at_most,
};
use crate::sphere::StripeSampling;
use crate::{Error, Result};

/// Everything needed to build a model's modules and to check its weight file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// Auto-encoder or auto-decoder.
    pub kind: ModelKind,
    /// N, the number of latent vectors in R³; the paper's D is 3N.
    pub latent_vectors: usize,
    /// The conditional neural field.
    #[serde(default)]
    pub decoder: DecoderConfig,
    /// The VN-ViT; absent in a decode-only model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder: Option<EncoderConfig>,
    /// The most compact lights that were taken out of a training panorama before the encoder and the losses saw it: the field describes
    /// what is left. 0: the paper's model, whose field holds everything.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub lights: usize,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_zero(n: &usize) -> bool {
    *n == 0
}

impl ModelConfig {
    /// The paper's decoder for N latent vectors, without an encoder.
    pub fn decode_only(latent_vectors: usize) -> Self {
        let decoder = DecoderConfig::default();
        Self { kind: ModelKind::Veni, latent_vectors, decoder, encoder: None, lights: 0 }
    }

    /// The most lights that are measured in a panorama that is encoded or fitted, unless somebody says otherwise: [`Lights::USUAL`], or as many
    /// as the training panoramas lost if these are more; 0 where the field holds everything.
    pub fn measured_lights(&self) -> usize {
        if self.lights == 0 { 0 } else { self.lights.max(Lights::USUAL) }
    }

    /// Checks every size: positive, and small enough that products of sizes stay far from overflow and what is computed
    /// with fits into memory.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the field, its value and what is allowed; [`Error::TooLarge`] for an encoder beyond the
    /// [limits](crate::limits).
    pub fn validate(&self) -> Result<()> {
        within("latent_vectors", self.latent_vectors, 4096)?;
        if self.lights > Lights::MOST {
            let (lights, most) = (self.lights, Lights::MOST);
            return Err(Error::invalid(format!("lights = {lights} is not between 0 and {most}")));
        }
        self.decoder.validate()?;
        let features = self.decoder.condition_inputs(self.latent_vectors) as u64;
        at_most("condition features", features, MAX_CONDITION_FEATURES)?;
        if self.decoder.conditioning == Conditioning::Tokens {
            let numbers = self.latent_vectors as u64 * self.decoder.hidden as u64;
            at_most("numbers of a ray's tokens", numbers, MAX_TOKEN_NUMBERS)?;
        }
        let Some(encoder) = &self.encoder else { return Ok(()) };
        within("encoder.stripes", encoder.stripes, 1 << 16)?;
        within("encoder.samples", encoder.samples.unwrap_or(1), 1 << 20)?;
        within("encoder.channels", encoder.channels, 8192)?;
        within("encoder.depth", encoder.depth, 256)?;
        within("encoder.heads", encoder.heads, 1024)?;
        within("encoder.head_channels", encoder.head_channels, 1024)?;
        within("encoder.feedforward", encoder.feedforward, 64)?;
        encoder.check_memory()
    }
}

pub(super) fn within(name: &str, value: usize, most: usize) -> Result<()> {
    if (1..=most).contains(&value) {
        return Ok(());
    }
    Err(Error::invalid(format!("{name} = {value} is not between 1 and {most}")))
}

/// Which system the weights belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ModelKind {
    /// Variational auto-encoder.
    Veni,
    /// RENI++ auto-decoder.
    Reni,
}

/// What the VN-ReLU subtracts when ⟨q, k⟩ < 0 (the Vector-Neuron paper against the reference implementation).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VnReluForm {
    /// q − ⟨q, k⟩/|k|² · k: the true projection (Deng et al. 2021). The default.
    #[default]
    Projection,
    /// q − ⟨q, k⟩/|k| · k with |k| = √max(Σk², 1e-6): the reference's `vn_layers`.
    Reference,
    /// q − ⟨q, k⟩/|k| · k with |k| = max(‖k‖, 1e-6): the reference's `sox_layers`, and RENI++.
    ReferenceNormGuard,
}

/// Vector-Neuron (coordinates never mixed) or SO(2) fully connected (equivariant and invariant parts).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VectorLayer {
    /// Vector Neurons.
    Vn,
    /// SO(2) fully connected.
    So2,
}

/// How the six feature coordinates (x, y, z, r, g, b) become the three of a latent vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reduction {
    /// The projection into the transformer drops to three.
    EarlyLearned,
    /// Six come out, the first three are kept.
    LateSplit,
    /// The output projection drops to three.
    LateLearned,
}

/// Which tokens leave the transformer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pooling {
    /// A class token with learned invariant coordinates.
    Cls,
    /// The mean over all tokens.
    Mean,
}

/// The Vector-Neuron Vision Transformer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EncoderConfig {
    /// T, the number of stripes (patches).
    pub stripes: usize,
    /// P, samples per stripe; T·P/2 must be a square. `None`: every sample is a token of one channel.
    pub samples: Option<usize>,
    /// Channels of a token.
    pub channels: usize,
    /// Transformer blocks.
    pub depth: usize,
    /// Attention heads.
    pub heads: usize,
    /// Channels per head.
    pub head_channels: usize,
    /// Feed-forward expansion.
    pub feedforward: usize,
    /// Layer that maps samples to channels.
    pub project_in: VectorLayer,
    /// Layers of the transformer.
    pub transformer: VectorLayer,
    /// Layers that read the latent from the output token.
    pub project_out: VectorLayer,
    /// Where six coordinates become three.
    pub reduction: Reduction,
    /// Output token.
    pub pooling: Pooling,
    /// Whether the class token's invariant coordinates are trained.
    pub learnable_cls: bool,
    /// Whether a variance is predicted.
    pub variational: bool,
    /// Form of the VN-ReLU.
    pub vn_relu: VnReluForm,
    /// Sampling of the panorama.
    pub sampling: StripeSampling,
}

impl EncoderConfig {
    /// What encoding one image holds, which no tensor of the file bounds.
    fn check_memory(&self) -> Result<()> {
        let [stripes, channels, heads] = [self.stripes, self.channels, self.heads].map(|n| n as u64);
        let each = self.samples.map_or(stripes / 2, |n| n as u64);
        let samples = stripes * each;
        at_most("samples (encoder.stripes × encoder.samples)", samples, MAX_ENCODER_SAMPLES)?;
        let tokens = 1 + if self.samples.is_some() { stripes } else { samples };
        // rows are padded to whole vectors, those of heads each
        let row = |n: u64| n.next_multiple_of(16);
        let inner = row(heads * self.head_channels as u64) + 16 * heads;
        let widest = 2 * row(channels) + 6 * inner + row(channels * self.feedforward as u64);
        // six coordinates
        at_most("numbers of an encoder's buffers", 6 * tokens * widest, MAX_ENCODER_NUMBERS)
    }
}

impl Default for EncoderConfig {
    /// The paper's size.
    fn default() -> Self {
        Self {
            stripes: 64,
            samples: Some(512),
            channels: 256,
            depth: 6,
            heads: 8,
            head_channels: 32,
            feedforward: 4,
            project_in: VectorLayer::So2,
            transformer: VectorLayer::Vn,
            project_out: VectorLayer::So2,
            reduction: Reduction::LateLearned,
            pooling: Pooling::Cls,
            learnable_cls: true,
            variational: true,
            vn_relu: VnReluForm::Projection,
            sampling: StripeSampling::Exact,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoders_that_would_fill_the_memory_are_refused_by_their_configuration() {
        let with = |change: fn(&mut EncoderConfig)| {
            let mut encoder = EncoderConfig::default();
            change(&mut encoder);
            let config = ModelConfig { encoder: Some(encoder), ..ModelConfig::decode_only(9) };
            config.validate()
        };
        with(|_| {}).unwrap();
        // every sample a token, as in the paper's comparison
        with(|e| (e.stripes, e.samples, e.channels) = (128, None, 64)).unwrap();
        for (change, what) in [
            ((|e| (e.stripes, e.samples) = (1 << 16, Some(1 << 15))) as fn(&mut EncoderConfig), "samples"),
            (|e| (e.stripes, e.samples, e.channels) = (1 << 16, Some(8), 8192), "buffers"),
            (|e| (e.stripes, e.samples, e.heads) = (1 << 14, Some(32), 1024), "buffers"),
            (|e| (e.stripes, e.samples) = (1 << 16, None), "samples"),
        ] {
            let error = with(change).unwrap_err();
            assert!(matches!(&error, Error::TooLarge { message, .. } if message.contains(what)), "{error}");
        }
    }

    #[test]
    fn decoders_that_would_fill_the_memory_are_refused_by_their_configuration() {
        use crate::model::Invariance;
        let with = |vectors, change: fn(&mut DecoderConfig)| {
            let mut config = ModelConfig::decode_only(vectors);
            change(&mut config.decoder);
            config.validate()
        };
        with(300, |d| (d.conditioning, d.invariance) = (Conditioning::Tokens, Invariance::GramMatrix))
            .unwrap();
        for (vectors, change, what) in [
            (
                4096,
                (|d| d.invariance = Invariance::GramMatrix) as fn(&mut DecoderConfig),
                "condition features",
            ),
            (4096, |d| (d.conditioning, d.hidden) = (Conditioning::Tokens, 512), "tokens"),
        ] {
            let error = with(vectors, change).unwrap_err();
            assert!(matches!(&error, Error::TooLarge { message, .. } if message.contains(what)), "{error}");
        }
    }
}
