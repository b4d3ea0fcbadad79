//! The ReLU of an SO(2) feature.

use super::so2_linear::So2Feature;
use super::{VnRelu, VnReluConfig};
use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};
use veni_light::random::Stream;

/// [`VnRelu`] on x and y, max(·, 0) on each invariant coordinate.
#[derive(Module, Debug)]
pub struct So2Relu {
    /// The layer on x and y.
    pub vn: VnRelu,
}

impl So2Relu {
    /// Draws the weights of the equivariant part.
    pub fn init(config: VnReluConfig, rng: &mut Stream, device: &Device) -> Self {
        Self { vn: config.init(rng, device) }
    }

    /// Applies the layer.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, 2 + c, channel]`
    /// - output: the same
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let So2Feature { equivariant, invariant } = So2Feature::split(x);
        So2Feature { equivariant: self.vn.forward(equivariant), invariant: relu(invariant) }.join()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, rng, rotate_xy};
    use veni_light::model::VnReluForm;

    #[test]
    fn commutes_with_rotation_and_has_the_right_gradients() {
        let device = Device::flex().autodiff();
        let config = VnReluConfig { channels: 5, form: VnReluForm::Projection };
        let layer = So2Relu::init(config, &mut rng(1), &device);
        let x = features([2, 3, 6, 5], 2, &device);
        let rotated = layer.forward(rotate_xy(x.clone(), 2.1));
        assert!(max_difference(rotated, rotate_xy(layer.forward(x.clone()), 2.1)) < 1e-5);
        assert_gradients(layer, x, So2Relu::forward);
    }
}
