//! Layer norm of a vector feature: lengths are normalised over channels, directions are kept. MODEL (6).

use super::norm::coordinate_norm;
use burn::module::{Module, Param};
use burn::tensor::module::layer_norm;
use burn::tensor::{Device, Tensor};

/// Size of a [`VnLayerNorm`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VnLayerNormConfig {
    /// Channels.
    pub channels: usize,
}

/// With n_c = |X_c| over the coordinates: Y_c = LN(n)_c · X_c / max(n_c, 1e-6), where LN normalises over channels
/// (biased variance, ε = 1e-5) with gain γ and no offset. A negative γ or a length below the mean turns a vector
/// round. Commutes with every orthogonal map of the coordinates.
#[derive(Module, Debug)]
pub struct VnLayerNorm {
    /// γ, `[channels]`, initially 1.
    pub gamma: Param<Tensor<1>>,
}

impl VnLayerNormConfig {
    /// Gains of one.
    pub fn init(&self, device: &Device) -> VnLayerNorm {
        VnLayerNorm { gamma: Param::from_tensor(Tensor::ones([self.channels], device)) }
    }
}

impl VnLayerNorm {
    /// Applies the layer.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinate, channel]`
    /// - output: the same
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let length = coordinate_norm(x.clone());
        let normalised = layer_norm(length.clone(), self.gamma.val(), None, 1e-5);
        x * (normalised / length.clamp_min(1e-6))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, rotate_xy};

    #[test]
    fn lengths_are_standardised_and_directions_kept() {
        let device = Device::flex();
        let layer = VnLayerNormConfig { channels: 16 }.init(&device);
        let x = features([2, 3, 6, 16], 2, &device);
        let y = layer.forward(x.clone());
        // the signed length of y along x has mean 0 and variance 1 over channels
        let signed = (y.clone() * x.clone()).sum_dim(2) / coordinate_norm(x.clone());
        assert!(signed.clone().mean_dim(3).abs().max().into_scalar::<f32>() < 1e-5);
        let variance = (signed.clone() * signed).mean_dim(3);
        assert!((variance - 1.0).abs().max().into_scalar::<f32>() < 1e-2);
        assert!(max_difference(layer.forward(rotate_xy(x, 0.4)), rotate_xy(y, 0.4)) < 1e-5);
    }

    #[test]
    fn gradients_also_at_zero() {
        let device = Device::flex().autodiff();
        let layer = VnLayerNormConfig { channels: 5 }.init(&device);
        assert_gradients(layer.clone(), features([1, 3, 3, 5], 4, &device), VnLayerNorm::forward);
        let x = Tensor::<4>::zeros([1, 2, 3, 5], &device).require_grad();
        let gradient = x.grad(&layer.forward(x.clone()).sum().backward()).unwrap();
        assert!(gradient.is_finite().all().into_scalar::<bool>());
    }
}
