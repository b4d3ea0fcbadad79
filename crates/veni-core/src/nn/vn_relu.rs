//! The Vector-Neuron ReLU: a vector that points away from a learned direction loses its part along it. MODEL (5).

use super::init::uniform;
use super::norm::{COORDINATE, squared_coordinate_norm};
use super::vn_linear::matmul_channels;
use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};
use veni_light::model::VnReluForm;
use veni_light::random::Stream;

/// Size and form of a [`VnRelu`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VnReluConfig {
    /// Channels, in and out.
    pub channels: usize,
    /// What is subtracted.
    pub form: VnReluForm,
}

/// With q = X W and k = X U, per channel: q where ⟨q, k⟩ ≥ 0, else q − ⟨q, k⟩/g · k, where g is
///
/// - [`Projection`](VnReluForm::Projection): |k|², so that the result is the true projection of q onto k's
///   normal plane, positively homogeneous in X;
/// - [`Reference`](VnReluForm::Reference): √max(|k|², 1e-6); divided by |k| once only, it subtracts |k| times as
///   much;
/// - [`ReferenceNormGuard`](VnReluForm::ReferenceNormGuard): max(|k|, 1e-6).
///
/// Commutes with every orthogonal map of the coordinates.
#[derive(Module, Debug)]
pub struct VnRelu {
    /// W, `[channels, channels]`, U(−1/√channels, 1/√channels).
    pub w: Param<Tensor<2>>,
    /// U, `[channels, channels]`, U(−1/√channels, 1/√channels).
    pub u: Param<Tensor<2>>,
    /// The form.
    #[module(skip)]
    pub form: VnReluForm,
}

impl VnReluConfig {
    /// Draws the weights.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> VnRelu {
        let bound = 1.0 / (self.channels as f64).sqrt();
        let shape = [self.channels, self.channels];
        VnRelu {
            w: uniform(shape, bound, rng, device),
            u: uniform(shape, bound, rng, device),
            form: self.form,
        }
    }
}

impl VnRelu {
    /// Applies the layer.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinate, channel]`
    /// - output: the same
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let q = matmul_channels(x.clone(), self.w.val());
        let k = matmul_channels(x, self.u.val());
        vn_relu(q, k, self.form)
    }
}

/// q − min(⟨q, k⟩, 0)/g · k with g as [`VnRelu`] says.
///
/// # Shapes
/// - `q`, `k`: `[batch, token, coordinate, channel]`
/// - output: the same
pub fn vn_relu(q: Tensor<4>, k: Tensor<4>, form: VnReluForm) -> Tensor<4> {
    let square = squared_coordinate_norm(k.clone());
    let divisor = match form {
        // Only guards 0/0: it acts where |k| < 1e-15.
        VnReluForm::Projection => square.clamp_min(1e-30),
        VnReluForm::Reference => square.clamp_min(1e-6).sqrt(),
        VnReluForm::ReferenceNormGuard => square.clamp_min(1e-12).sqrt(),
    };
    let along = (q.clone() * k.clone()).sum_dim(COORDINATE);
    // relu(−⟨q, k⟩), not min(⟨q, k⟩, 0): its derivative at 0 is 0, as on the side where q passes unchanged.
    q + k * (relu(-along) / divisor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, rng, rotate_xy};

    const FORMS: [VnReluForm; 3] =
        [VnReluForm::Projection, VnReluForm::Reference, VnReluForm::ReferenceNormGuard];

    fn layer(form: VnReluForm, device: &Device) -> VnRelu {
        VnReluConfig { channels: 5, form }.init(&mut rng(2), device)
    }

    #[test]
    fn commutes_with_rotation() {
        let device = Device::flex();
        let x = features([2, 3, 6, 5], 1, &device);
        for form in FORMS {
            let layer = layer(form, &device);
            let rotated = layer.forward(rotate_xy(x.clone(), 2.1));
            assert!(max_difference(rotated, rotate_xy(layer.forward(x.clone()), 2.1)) < 1e-5);
        }
    }

    #[test]
    fn projection_leaves_nothing_against_k_and_scales() {
        let device = Device::flex();
        let (q, k) = (features([2, 3, 6, 5], 1, &device), features([2, 3, 6, 5], 2, &device));
        let y = vn_relu(q.clone(), k.clone(), VnReluForm::Projection);
        let least = (y.clone() * k.clone()).sum_dim(2).min().into_scalar::<f32>();
        assert!(least > -1e-5, "{least}");
        // a longer k changes what the single normalisation subtracts, and not the projection
        let longer = |form| vn_relu(q.clone(), k.clone() * 3.0, form);
        assert!(max_difference(longer(VnReluForm::Projection), y.clone()) < 1e-5);
        assert!(max_difference(longer(VnReluForm::Reference), y.clone()) > 1e-2);
        assert!(max_difference(vn_relu(q * 7.0, k * 7.0, VnReluForm::Projection), y * 7.0) < 1e-4);
    }

    #[test]
    fn gradients_of_every_form_also_at_zero() {
        let device = Device::flex().autodiff();
        for form in FORMS {
            let layer = layer(form, &device);
            assert_gradients(layer.clone(), features([1, 3, 3, 5], 4, &device), VnRelu::forward);
            let x = Tensor::<4>::zeros([1, 2, 3, 5], &device).require_grad();
            let gradients = layer.forward(x.clone()).sum().backward();
            for finite in [
                x.grad(&gradients).unwrap().is_finite().all(),
                layer.u.val().grad(&gradients).unwrap().is_finite().all(),
            ] {
                assert!(finite.into_scalar::<bool>(), "{form:?}");
            }
        }
    }
}
