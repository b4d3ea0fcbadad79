//! From vectors to numbers that no rotation changes. MODEL (17).

use super::norm::COORDINATE;
use super::{VnLinear, VnLinearConfig, VnRelu, VnReluConfig};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use veni_light::model::VnReluForm;
use veni_light::random::Stream;

/// Sizes of a [`VnInvariant`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VnInvariantConfig {
    /// Channels that come in.
    pub channels: usize,
    /// c, the number of coordinates, and of invariants that come out.
    pub coordinates: usize,
    /// Form of the ReLU.
    pub form: VnReluForm,
}

/// a = VnReLU(X W) holds c vectors that rotate with X; out_o = Σ_channel ⟨X_channel, a_o⟩.
#[derive(Module, Debug)]
pub struct VnInvariant {
    /// W, channels to c.
    pub linear: VnLinear,
    /// The ReLU on c channels.
    pub relu: VnRelu,
}

impl VnInvariantConfig {
    /// Draws the weights.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> VnInvariant {
        VnInvariant {
            linear: VnLinearConfig::new(self.channels, self.coordinates).init(rng, device),
            relu: VnReluConfig { channels: self.coordinates, form: self.form }.init(rng, device),
        }
    }
}

impl VnInvariant {
    /// Applies the layer.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, c, channel]`
    /// - output: `[batch, token, c]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<3> {
        let frame = self.relu.forward(self.linear.forward(x.clone()));
        // Σ over channels first: it does not meet the index o.
        (x.sum_dim(3) * frame).sum_dim(COORDINATE).squeeze_dim(COORDINATE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, reflect_y, rng, rotate_xy};

    #[test]
    fn is_invariant_and_has_the_right_gradients() {
        let device = Device::flex().autodiff();
        for form in [VnReluForm::Projection, VnReluForm::Reference] {
            let config = VnInvariantConfig { channels: 4, coordinates: 3, form };
            let layer = config.init(&mut rng(1), &device);
            let x = features([2, 3, 3, 4], 2, &device);
            let y = layer.forward(x.clone());
            assert_eq!(y.dims(), [2, 3, 3]);
            let wide = |t: Tensor<3>| t.unsqueeze_dim::<4>(2);
            assert!(max_difference(wide(y.clone()), wide(layer.forward(rotate_xy(x.clone(), 0.4)))) < 1e-5);
            assert!(max_difference(wide(y), wide(layer.forward(reflect_y(x.clone())))) < 1e-5);
            assert_gradients(layer, x, move |l, x| wide(l.forward(x)));
        }
    }
}
