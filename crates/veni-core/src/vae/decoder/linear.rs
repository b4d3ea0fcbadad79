//! An affine map on the last axis, initialised from our own random numbers.

use crate::nn::uniform;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, module};
use veni_light::random::Stream;

/// y = x W + b on row vectors: weight `[in, out]`, bias `[out]`.
#[derive(Module, Debug)]
pub struct Linear {
    /// W, [in, out].
    pub weight: Param<Tensor<2>>,
    /// b, `[out]`.
    pub bias: Param<Tensor<1>>,
}

impl Linear {
    /// Weight and bias uniform in ±1/√inputs.
    pub fn new(inputs: usize, outputs: usize, rng: &mut Stream, device: &Device) -> Self {
        let bound = 1.0 / (inputs as f64).sqrt();
        Self {
            weight: uniform([inputs, outputs], bound, rng, device),
            bias: uniform([outputs], bound, rng, device),
        }
    }

    /// [..., in] → [..., out].
    pub fn forward<const D: usize>(&self, x: Tensor<D>) -> Tensor<D> {
        module::linear(x, self.weight.val(), Some(self.bias.val()))
    }
}
