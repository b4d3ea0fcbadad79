//! Hyper-parameters of the decoder: the paper's network and the systems that it is compared with.
//!
//! Every option's default is the paper's network, and an option at its default is not written: files, and the
//! [`hash`](super::Model::hash) of their decoders, are the same as before there was the option.

use serde::{Deserialize, Serialize};

use super::VnReluForm;
use super::config::within;
use crate::{Error, Result};

/// The conditional neural field.
///
/// | system | conditioning | invariance | encoding | output |
/// |---|---|---|---|---|
/// | VENI, RENI++ | attention | VN | directions | linear |
/// | RENI (2022) | FiLM or concat | Gram matrix | none | tanh |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DecoderConfig {
    /// Features of a hidden layer.
    pub hidden: usize,
    /// Layers between the input map and the output map: residual ones, or sines.
    pub layers: usize,
    /// Heads of the attention. With [`Conditioning::Attention`], whose attention has one key, they change nothing
    /// that is computed and are kept for export; with [`Conditioning::Tokens`] they must divide `hidden`.
    pub heads: usize,
    /// Form of the VN-ReLU in [`Invariance::Vn`].
    pub vn_relu: VnReluForm,
    /// How the latent enters the network.
    #[serde(skip_serializing_if = "is_default")]
    pub conditioning: Conditioning,
    /// What the network is conditioned on apart from the latent's products with the direction.
    #[serde(skip_serializing_if = "is_default")]
    pub invariance: Invariance,
    /// Which rotations of latent and direction together leave the radiance as it is.
    #[serde(skip_serializing_if = "is_default")]
    pub equivariance: Equivariance,
    /// Which inputs pass through the encoding by sines.
    #[serde(skip_serializing_if = "is_default")]
    pub encoding: Encoding,
    /// What the output map gives.
    #[serde(skip_serializing_if = "is_default")]
    pub output: OutputForm,
    /// ω of the sine layers of [`Conditioning::Concat`]: sin(ω(Wx + b)).
    #[serde(skip_serializing_if = "omega_is_default")]
    pub omega: f64,
    /// Hidden layers of FiLM's mapping network.
    #[serde(skip_serializing_if = "mapping_layers_is_default")]
    pub mapping_layers: usize,
    /// Features of FiLM's mapping network.
    #[serde(skip_serializing_if = "mapping_features_is_default")]
    pub mapping_features: usize,
}

impl Default for DecoderConfig {
    /// The paper's.
    fn default() -> Self {
        Self {
            hidden: 128,
            layers: 6,
            heads: 8,
            vn_relu: VnReluForm::Projection,
            conditioning: Conditioning::Attention,
            invariance: Invariance::Vn,
            equivariance: Equivariance::So2,
            encoding: Encoding::Directions,
            output: OutputForm::Linear,
            omega: OMEGA,
            mapping_layers: MAPPING_LAYERS,
            mapping_features: MAPPING_FEATURES,
        }
    }
}

const OMEGA: f64 = 30.0;
const MAPPING_LAYERS: usize = 3;
const MAPPING_FEATURES: usize = 128;

/// How the latent enters the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conditioning {
    /// RENI++'s attention with a single key: a vector per layer and latent.
    #[default]
    Attention,
    /// A mapping network gives frequency and phase of every sine of a SIREN (Perez et al. 2018, Chan et al. 2021).
    Film,
    /// Latent and direction side by side into a SIREN (Sitzmann et al. 2020).
    Concat,
    /// Attention of the ray over one token per latent vector.
    Tokens,
}

/// What the network is conditioned on apart from the latent's products with the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Invariance {
    /// The Vector-Neuron invariants of each latent vector on its own.
    #[default]
    Vn,
    /// All inner products of the latent vectors.
    GramMatrix,
}

/// Which rotations of latent and direction together leave the radiance as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Equivariance {
    /// About z.
    #[default]
    So2,
    /// All.
    So3,
    /// None: the network is conditioned on the latent itself.
    None,
}

/// Which inputs pass through the encoding by sines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encoding {
    /// The directional input.
    #[default]
    Directions,
    /// How the latent's condition features are made.
    Condition,
    /// Each of the two.
    Both,
    /// Neither.
    None,
}

/// What the output map y = W x + b gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutputForm {
    /// y is log radiance.
    #[default]
    Linear,
    /// sin(ω y) is log radiance: a SIREN whose last layer is a sine.
    Sine,
    /// ½(tanh y + 1)(max − min) + min is log radiance, with the range [`TANH_RANGE`](OutputForm::TANH_RANGE) of
    /// RENI (2022).
    Tanh,
}

impl OutputForm {
    /// (min, max) of log radiance under [`OutputForm::Tanh`].
    pub const TANH_RANGE: [f64; 2] = [-18.0536, 11.4633];
}

impl DecoderConfig {
    /// RENI (2022): FiLM, Gram matrix, plain inputs, tanh; five sine layers of 128 and three mapping layers of 128.
    pub fn reni_2022() -> Self {
        Self {
            layers: 4,
            conditioning: Conditioning::Film,
            invariance: Invariance::GramMatrix,
            encoding: Encoding::None,
            output: OutputForm::Tanh,
            ..Self::default()
        }
    }

    /// Checks sizes and that they fit together.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the field, its value and what is allowed.
    pub(super) fn validate(&self) -> Result<()> {
        within("decoder.hidden", self.hidden, 8192)?;
        within("decoder.layers", self.layers, 256)?;
        within("decoder.heads", self.heads, self.hidden)?;
        within("decoder.mapping_layers", self.mapping_layers, 256)?;
        within("decoder.mapping_features", self.mapping_features, 8192)?;
        if self.conditioning == Conditioning::Tokens && !self.hidden.is_multiple_of(self.heads) {
            let Self { hidden, heads, .. } = self;
            return Err(Error::invalid(format!(
                "decoder.heads = {heads} does not divide decoder.hidden = {hidden}"
            )));
        }
        if !(self.omega > 0.0 && self.omega.is_finite()) {
            return Err(Error::invalid(format!("decoder.omega = {}: must be positive", self.omega)));
        }
        Ok(())
    }

    /// Columns of the directional input for N latent vectors, after its encoding.
    pub fn direction_inputs(&self, latent_vectors: usize) -> usize {
        let width = match self.equivariance {
            Equivariance::So2 => latent_vectors + 2,
            Equivariance::So3 | Equivariance::None => latent_vectors,
        };
        if self.encodes_directions() { 5 * width } else { width }
    }

    /// Number of condition features of each latent vector, before their encoding.
    pub fn token_inputs(&self, latent_vectors: usize) -> usize {
        match (self.invariance, self.equivariance) {
            (_, Equivariance::None) | (Invariance::Vn, _) => 3,
            (Invariance::GramMatrix, Equivariance::So2) => latent_vectors + 1,
            (Invariance::GramMatrix, Equivariance::So3) => latent_vectors,
        }
    }

    /// Number of condition features of the latent, after their encoding.
    pub fn condition_inputs(&self, latent_vectors: usize) -> usize {
        let width = latent_vectors * self.token_inputs(latent_vectors);
        if self.encodes_condition() { 5 * width } else { width }
    }

    /// Channels of the Vector-Neuron layer, if there is one.
    pub fn vn_channels(&self) -> Option<usize> {
        match (self.invariance, self.equivariance) {
            (Invariance::Vn, Equivariance::So2) => Some(2),
            (Invariance::Vn, Equivariance::So3) => Some(3),
            (Invariance::GramMatrix, _) | (_, Equivariance::None) => None,
        }
    }

    /// Whether the directional input is encoded.
    pub fn encodes_directions(&self) -> bool {
        matches!(self.encoding, Encoding::Directions | Encoding::Both)
    }

    /// Whether the condition features are encoded.
    pub fn encodes_condition(&self) -> bool {
        matches!(self.encoding, Encoding::Condition | Encoding::Both)
    }

    /// Checks that the network is one that [`Field`](crate::field::Field) evaluates, and the GPU: the paper's, of any
    /// size.
    ///
    /// # Errors
    /// [`Error::Unsupported`] naming the option that differs.
    pub fn check_folds(&self) -> Result<()> {
        let paper = Self::default();
        let differs = |name: &str, value: serde_json::Result<serde_json::Value>| {
            let value = value.ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default();
            Err(Error::unsupported(format!(
                "decoder.{name} = {value}: only the paper's network (attention, vn, so2) is baked; this one is for \
                 training and comparison"
            )))
        };
        match self {
            c if c.conditioning != paper.conditioning => {
                differs("conditioning", serde_json::to_value(c.conditioning))
            }
            c if c.invariance != paper.invariance => {
                differs("invariance", serde_json::to_value(c.invariance))
            }
            c if c.equivariance != paper.equivariance => {
                differs("equivariance", serde_json::to_value(c.equivariance))
            }
            c if c.encoding != paper.encoding => differs("encoding", serde_json::to_value(c.encoding)),
            c if c.output != paper.output => differs("output", serde_json::to_value(c.output)),
            _ => Ok(()),
        }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn omega_is_default(omega: &f64) -> bool {
    *omega == OMEGA
}

fn mapping_layers_is_default(layers: &usize) -> bool {
    *layers == MAPPING_LAYERS
}

fn mapping_features_is_default(features: &usize) -> bool {
    *features == MAPPING_FEATURES
}
