//! The SO(2) fully connected layer: equivariant and invariant coordinates feed each other. MODEL (7, 8).

use super::init::uniform;
use super::norm::{COORDINATE, coordinate_norm};
use super::vn_linear::matmul_channels;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use veni_light::random::Stream;

/// Sizes of a [`So2Linear`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct So2LinearConfig {
    /// d, channels that come in.
    pub input: usize,
    /// o, channels that go out.
    pub output: usize,
    /// c, invariant coordinates that come in (after x and y).
    pub invariants_in: usize,
    /// c′, invariant coordinates that go out.
    pub invariants_out: usize,
}

/// With x_i ∈ R² the equivariant and z_i ∈ R^c the invariant coordinates of channel i, n_i = |x_i|,
///
/// - equivariant: y_o = Σ_i Σ_k We\[k, i, o\] t_k,i x_i, where t_i = (1, z_i);
/// - invariant: w_j,o = b\[j, o\] + Σ_i Σ_k Wi\[k, i, j, o\] s_k,i, where s_i = (z_i, n_i).
///
/// Both are one matrix product: of the (c+1)·d products t_k,i x_i, and of the (c+1)·d numbers s_k,i. The layer
/// commutes with rotations and reflections of x, y.
#[derive(Module, Debug)]
pub struct So2Linear {
    /// We, `[(c+1)·d, o]`, rows k-major (k = 0 is the one), U(−κ, κ) with κ = 1/√(d(c+1)+o).
    pub equivariant: Param<Tensor<2>>,
    /// Wi, `[(c+1)·d, c′·o]`, rows k-major (k = c is the norm), columns coordinate-major,
    /// U(−κ, κ) with κ = 1/√(d(c+1)).
    pub invariant: Param<Tensor<2>>,
    /// b, `[c′·o]`, as the columns of Wi, same distribution.
    pub bias: Param<Tensor<1>>,
}

impl So2LinearConfig {
    /// Draws the weights.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> So2Linear {
        let Self { input, output, invariants_in, invariants_out } = *self;
        let terms = input * (invariants_in + 1);
        let equivariant_bound = 1.0 / ((terms + output) as f64).sqrt();
        let invariant_bound = 1.0 / (terms as f64).sqrt();
        So2Linear {
            equivariant: uniform([terms, output], equivariant_bound, rng, device),
            invariant: uniform([terms, invariants_out * output], invariant_bound, rng, device),
            bias: uniform([invariants_out * output], invariant_bound, rng, device),
        }
    }
}

/// The equivariant and the invariant coordinates of a vector feature, apart.
#[derive(Clone, Debug)]
pub(crate) struct So2Feature {
    /// x and y: `[batch, token, 2, channel]`.
    pub(crate) equivariant: Tensor<4>,
    /// The c others: `[batch, token, c, channel]`.
    pub(crate) invariant: Tensor<4>,
}

impl So2Feature {
    /// Takes `[batch, token, 2 + c, channel]` apart.
    pub(crate) fn split(x: Tensor<4>) -> Self {
        let coordinates = x.dims()[COORDINATE];
        assert!(
            coordinates > 2,
            "an SO(2) feature has x, y and at least one invariant, not {coordinates} coordinates"
        );
        Self {
            equivariant: x.clone().narrow(COORDINATE, 0, 2),
            invariant: x.narrow(COORDINATE, 2, coordinates - 2),
        }
    }

    /// Puts the coordinates together again: `[batch, token, 2 + c, channel]`.
    pub(crate) fn join(self) -> Tensor<4> {
        Tensor::cat(vec![self.equivariant, self.invariant], COORDINATE)
    }

    /// The products t_k,i x_i: `[batch, token, 2, (c+1)·channel]`, k-major.
    pub(crate) fn equivariant_terms(&self) -> Tensor<4> {
        let [batch, tokens, invariants, channels] = self.invariant.dims();
        let options = (&self.invariant.device(), self.invariant.dtype());
        let one = Tensor::<4>::ones([batch, tokens, 1, channels], options);
        let factors: Tensor<5> =
            Tensor::cat(vec![one, self.invariant.clone()], COORDINATE).unsqueeze_dim(COORDINATE);
        let vectors: Tensor<5> = self.equivariant.clone().unsqueeze_dim(3);
        (vectors * factors).reshape([batch, tokens, 2, (invariants + 1) * channels])
    }

    /// The numbers s_k,i: `[batch, token, 1, (c+1)·channel]`, k-major.
    pub(crate) fn invariant_terms(&self) -> Tensor<4> {
        let [batch, tokens, invariants, channels] = self.invariant.dims();
        let length = coordinate_norm(self.equivariant.clone());
        Tensor::cat(vec![self.invariant.clone(), length], COORDINATE).reshape([
            batch,
            tokens,
            1,
            (invariants + 1) * channels,
        ])
    }
}

impl So2Linear {
    /// Applies the layer.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, 2 + c, input]`
    /// - output: `[batch, token, 2 + c′, output]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        self.forward_parts(&So2Feature::split(x)).join()
    }

    /// [`forward`](Self::forward) on coordinates that are apart already.
    pub(crate) fn forward_parts(&self, x: &So2Feature) -> So2Feature {
        So2Feature {
            equivariant: matmul_channels(x.equivariant_terms(), self.equivariant.val()),
            invariant: self.forward_invariant(x),
        }
    }

    /// The layer that gives for inputs of `channels` channels with x, y and the first invariant (z) negated what
    /// this one gives for the inputs themselves.
    ///
    /// Of the products t_k,i x_i all change sign but z x_i; of the numbers s_k,i only z does. These rows of We
    /// and Wi are negated, so the results are the same to the bit.
    pub(crate) fn for_negated_directions(self, channels: usize) -> Self {
        let rewrite = |weights: Param<Tensor<2>>, negated: fn(usize) -> bool| {
            weights.map(|w| {
                let (terms, device, tracked) = (w.dims()[0], w.device(), w.is_require_grad());
                let sign = |row: usize| if negated(row / channels) { -1f32 } else { 1.0 };
                let signs = TensorData::new((0..terms).map(sign).collect(), [terms, 1]);
                Tensor::from_data((w * Tensor::from_data(signs, &device)).into_data(), &device)
                    .set_require_grad(tracked)
            })
        };
        Self {
            equivariant: rewrite(self.equivariant, |k| k != 1),
            invariant: rewrite(self.invariant, |k| k == 0),
            bias: self.bias,
        }
    }

    /// The invariant half: `[batch, token, c′, output]`.
    pub(crate) fn forward_invariant(&self, x: &So2Feature) -> Tensor<4> {
        let [batch, tokens, ..] = x.invariant.dims();
        let [_, output] = self.equivariant.val().dims();
        let y = matmul_channels(x.invariant_terms(), self.invariant.val());
        (y + self.bias.val().reshape([1, 1, 1, -1])).reshape([batch as i64, tokens as i64, -1, output as i64])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, reflect_y, rng, rotate_xy};

    fn config() -> So2LinearConfig {
        So2LinearConfig { input: 5, output: 4, invariants_in: 4, invariants_out: 1 }
    }

    #[test]
    fn commutes_with_rotation_and_reflection() {
        let device = Device::flex();
        let x = features([2, 3, 6, 5], 1, &device);
        let layer = config().init(&mut rng(2), &device);
        let y = layer.forward(x.clone());
        assert_eq!(y.dims(), [2, 3, 3, 4]);
        let rotated = layer.forward(rotate_xy(x.clone(), 2.1));
        assert!(max_difference(rotated, rotate_xy(y.clone(), 2.1)) < 1e-5);
        assert!(max_difference(layer.forward(reflect_y(x)), reflect_y(y)) < 1e-5);
    }

    #[test]
    fn gradients_also_where_xy_is_zero() {
        let device = Device::flex().autodiff();
        let layer = config().init(&mut rng(3), &device);
        assert_gradients(layer.clone(), features([1, 3, 6, 5], 4, &device), So2Linear::forward);
        let x = Tensor::<4>::zeros([1, 2, 6, 5], &device).require_grad();
        let gradient = x.grad(&layer.forward(x.clone()).sum().backward()).unwrap();
        assert!(gradient.is_finite().all().into_scalar::<bool>());
    }
}
