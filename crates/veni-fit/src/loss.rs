//! The losses over whole images that training minimises, as settings: their forms and weights. What computes them is in
//! veni-core; a fit can be given one ([`PanoramaLoss`](crate::PanoramaLoss)).

use serde::{Deserialize, Serialize};

use crate::schedule::WeightSchedule;

/// Mathematically right, or the reference implementation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LossForm {
    /// As described in the paper, with solid-angle weights at pixel centres.
    #[default]
    Corrected,
    /// As in the reference implementation.
    Reference,
}

/// The terms and their weights. A weight that is 0 for ever costs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LossConfig {
    /// Which form all terms take.
    pub form: LossForm,
    /// Scales of MAGE.
    pub mage_scales: usize,
    /// Multi-scale absolute gradient error.
    pub mage: WeightSchedule,
    /// Scale-invariant log error.
    pub scale_invariant: WeightSchedule,
    /// Exposure (log-mean) term: squared mean log error per image. The corrected forms of the terms above and of the
    /// cosine are all blind to a factor on the radiance; without this the decoder's exposure would be
    /// arbitrary. Not in the paper, whose gradient and cosine terms fix the exposure by accident.
    #[serde(alias = "level")]
    pub exposure: WeightSchedule,
    /// Colour direction.
    pub cosine: WeightSchedule,
    /// Divergence of the posterior from the prior.
    pub kld: WeightSchedule,
    /// Mean squared error of log radiance.
    pub log_mse: WeightSchedule,
    /// Mean squared error of radiance.
    pub hdr_mse: WeightSchedule,
    /// Mean squared error of display values.
    pub ldr_mse: WeightSchedule,
    /// Mean squared error of the logarithm of irradiance, on surfaces that face 26 ways.
    #[serde(skip_serializing_if = "WeightSchedule::is_off")]
    pub irradiance: WeightSchedule,
}

impl Default for LossConfig {
    /// The paper's weights, and 1 for the exposure term.
    fn default() -> Self {
        let constant = WeightSchedule::Constant;
        Self {
            form: LossForm::Corrected,
            mage_scales: 2,
            mage: constant(0.5),
            scale_invariant: constant(1.0),
            exposure: constant(1.0),
            cosine: constant(1.0),
            kld: constant(0.01),
            log_mse: constant(0.0),
            hdr_mse: constant(0.0),
            ldr_mse: constant(0.0),
            irradiance: constant(0.0),
        }
    }
}

impl LossConfig {
    /// The reference implementation: reference forms, the paper's weights, no separate exposure term.
    pub fn reference() -> Self {
        Self { form: LossForm::Reference, exposure: WeightSchedule::Constant(0.0), ..Self::default() }
    }
}
