//! The Vector-Neuron linear layer. MODEL (4).

use super::init::uniform;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use veni_light::random::Stream;

/// Sizes of a [`VnLinear`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VnLinearConfig {
    /// Channels that come in.
    pub input: usize,
    /// Channels that go out.
    pub output: usize,
    /// ε, the length of the bias; 0 means no bias and exact equivariance.
    pub bias_length: f64,
}

/// Y = X W + ε b / max(|b|, 1e-12), the same for every coordinate.
///
/// W mixes channels, never coordinates, so without the bias the layer commutes with every linear map of the
/// coordinates. The optional bias has the fixed length ε over all channels and is added to each coordinate:
/// it breaks equivariance by at most ε ("quasi-equivariant").
#[derive(Module, Debug)]
pub struct VnLinear {
    /// W, `[input, output]`, U(−1/√input, 1/√input).
    pub weight: Param<Tensor<2>>,
    /// b, `[output]`, U(−1/√input, 1/√input); only its direction matters.
    pub bias: Option<Param<Tensor<1>>>,
    /// ε.
    pub bias_length: f64,
}

impl VnLinearConfig {
    /// Without bias.
    pub fn new(input: usize, output: usize) -> Self {
        Self { input, output, bias_length: 0.0 }
    }

    /// Draws the weights.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> VnLinear {
        let bound = 1.0 / (self.input as f64).sqrt();
        VnLinear {
            weight: uniform([self.input, self.output], bound, rng, device),
            bias: (self.bias_length > 0.0).then(|| uniform([self.output], bound, rng, device)),
            bias_length: self.bias_length,
        }
    }
}

impl VnLinear {
    /// Applies the layer.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinate, input]`
    /// - output: `[batch, token, coordinate, output]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let y = matmul_channels(x, self.weight.val());
        match &self.bias {
            Some(bias) => {
                let bias = bias.val();
                let length = (bias.clone() * bias.clone()).sum().clamp_min(1e-24).sqrt();
                y + (bias / length * self.bias_length).reshape([1, 1, 1, -1])
            }
            None => y,
        }
    }
}

/// X W over the last axis, as one two-dimensional matrix product.
///
/// # Shapes
/// - `x`: `[batch, token, coordinate, input]`
/// - `weight`: `[input, output]`
/// - output: `[batch, token, coordinate, output]`
pub(crate) fn matmul_channels(x: Tensor<4>, weight: Tensor<2>) -> Tensor<4> {
    let [batch, tokens, coordinates, channels] = x.dims();
    let [input, output] = weight.dims();
    assert_eq!(
        channels, input,
        "features [{batch}, {tokens}, {coordinates}, {channels}] do not fit weights [{input}, {output}]"
    );
    x.reshape([batch * tokens * coordinates, channels]).matmul(weight).reshape([
        batch,
        tokens,
        coordinates,
        output,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, rng, rotate_xy};

    #[test]
    fn commutes_with_rotation_unless_biased() {
        let device = Device::flex();
        let x = features([2, 3, 6, 5], 1, &device);
        let layer = VnLinearConfig::new(5, 4).init(&mut rng(2), &device);
        let rotated = layer.forward(rotate_xy(x.clone(), 0.7));
        assert!(max_difference(rotated, rotate_xy(layer.forward(x.clone()), 0.7)) < 1e-5);

        let biased =
            VnLinearConfig { bias_length: 0.1, ..VnLinearConfig::new(5, 4) }.init(&mut rng(2), &device);
        let broken =
            max_difference(biased.forward(rotate_xy(x.clone(), 0.7)), rotate_xy(biased.forward(x), 0.7));
        assert!(broken > 1e-3 && broken < 0.2, "{broken}");
    }

    #[test]
    fn gradients() {
        let device = Device::flex().autodiff();
        let layer =
            VnLinearConfig { bias_length: 0.5, ..VnLinearConfig::new(3, 4) }.init(&mut rng(3), &device);
        assert_gradients(layer, features([2, 2, 3, 3], 4, &device), VnLinear::forward);
    }
}
