//! The feed-forward block: expand, ReLU, contract. MODEL (10).

use super::so2_linear::So2Feature;
use super::vn_linear::matmul_channels;
use super::vn_relu::vn_relu;
use super::{VectorLinear, VectorLinearConfig, VnRelu, VnReluConfig};
use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};
use veni_light::model::{VectorLayer, VnReluForm};
use veni_light::random::Stream;

/// Sizes of a [`VectorFeedForward`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorFeedForwardConfig {
    /// Kind of its two linear maps.
    pub layer: VectorLayer,
    /// Channels, in and out.
    pub channels: usize,
    /// Inner channels are this many times `channels`.
    pub expansion: usize,
    /// Coordinates of a channel.
    pub coordinates: usize,
    /// Form of the ReLU.
    pub form: VnReluForm,
}

/// contract(ReLU(expand(X))).
///
/// The ReLU multiplies the expansion X A by W and by U with nothing in between, so q = X (A W) and k = X (A U).
/// The products of weights do not depend on the data: where there are more rows of X than channels they save
/// most of the work, and the gradient reaches A, W and U through them. For fewer rows the factors are applied
/// one after the other. Both give the same numbers up to rounding.
#[derive(Module, Debug)]
pub struct VectorFeedForward {
    /// A: channels to expansion · channels.
    pub expand: VectorLinear,
    /// W, U; in an SO(2) block the invariant coordinates get a plain ReLU.
    pub relu: VnRelu,
    /// Back to channels.
    pub contract: VectorLinear,
}

/// The products A W and A U of a feed-forward block, `[rows of A, inner channels]` each.
#[derive(Clone, Debug)]
pub struct GateWeights {
    w: Tensor<2>,
    u: Tensor<2>,
}

impl VectorFeedForwardConfig {
    /// Draws the weights.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> VectorFeedForward {
        let Self { layer, channels, expansion, coordinates, form } = *self;
        let inner = channels * expansion;
        VectorFeedForward {
            expand: VectorLinearConfig::new(layer, channels, inner, coordinates).init(rng, device),
            relu: VnReluConfig { channels: inner, form }.init(rng, device),
            contract: VectorLinearConfig::new(layer, inner, channels, coordinates).init(rng, device),
        }
    }
}

impl VectorFeedForward {
    /// Applies the block.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinate, channel]`
    /// - output: the same
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        if self.folding_pays(&x) { self.forward_folded(x, &self.fold()) } else { self.forward_factors(x) }
    }

    /// The products of weights; valid until a weight changes.
    pub fn fold(&self) -> GateWeights {
        let a = self.expansion();
        GateWeights { w: a.clone().matmul(self.relu.w.val()), u: a.matmul(self.relu.u.val()) }
    }

    /// [`forward`](Self::forward) with products computed before.
    pub fn forward_folded(&self, x: Tensor<4>, gates: &GateWeights) -> Tensor<4> {
        let gate = |x: Tensor<4>| {
            let q = matmul_channels(x.clone(), gates.w.clone());
            vn_relu(q, matmul_channels(x, gates.u.clone()), self.relu.form)
        };
        match &self.expand {
            VectorLinear::Vn(_) => self.contract.forward(gate(x)),
            VectorLinear::So2(expand) => {
                let x = So2Feature::split(x);
                let inner = So2Feature {
                    equivariant: gate(x.equivariant_terms()),
                    invariant: relu(expand.forward_invariant(&x)),
                };
                self.contract_parts(inner)
            }
        }
    }

    /// [`forward`](Self::forward), one factor after the other.
    fn forward_factors(&self, x: Tensor<4>) -> Tensor<4> {
        match &self.expand {
            VectorLinear::Vn(expand) => self.contract.forward(self.relu.forward(expand.forward(x))),
            VectorLinear::So2(expand) => {
                let So2Feature { equivariant, invariant } = expand.forward_parts(&So2Feature::split(x));
                self.contract_parts(So2Feature {
                    equivariant: self.relu.forward(equivariant),
                    invariant: relu(invariant),
                })
            }
        }
    }

    fn contract_parts(&self, x: So2Feature) -> Tensor<4> {
        match &self.contract {
            VectorLinear::So2(contract) => contract.forward_parts(&x).join(),
            VectorLinear::Vn(contract) => contract.forward(x.join()),
        }
    }

    /// A, `[rows, inner]`: of an SO(2) layer the equivariant half.
    fn expansion(&self) -> Tensor<2> {
        match &self.expand {
            VectorLinear::Vn(layer) => layer.weight.val(),
            VectorLinear::So2(layer) => layer.equivariant.val(),
        }
    }

    /// Compares the multiplications: 2 (a h² + m a h) with the products, m a h + 2 m h² without, for m rows of x
    /// and A of a × h.
    fn folding_pays(&self, x: &Tensor<4>) -> bool {
        let [batch, tokens, coordinates, _] = x.dims();
        let coordinates = if matches!(self.expand, VectorLinear::So2(_)) { 2 } else { coordinates };
        let rows = batch * tokens * coordinates;
        let [a, inner] = self.expansion().dims();
        2 * a * inner + rows * a < 2 * rows * inner
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, rng, rotate_xy};

    fn block(layer: VectorLayer, device: &Device) -> VectorFeedForward {
        let form = VnReluForm::Projection;
        VectorFeedForwardConfig { layer, channels: 3, expansion: 2, coordinates: 6, form }
            .init(&mut rng(2), device)
    }

    #[test]
    fn products_change_nothing_and_rotation_commutes() {
        let device = Device::flex();
        let x = features([2, 3, 6, 3], 1, &device);
        for layer in [VectorLayer::Vn, VectorLayer::So2] {
            let block = block(layer, &device);
            let factors = block.forward_factors(x.clone());
            assert!(max_difference(block.forward_folded(x.clone(), &block.fold()), factors.clone()) < 1e-5);
            assert!(max_difference(block.forward(rotate_xy(x.clone(), 1.1)), rotate_xy(factors, 1.1)) < 1e-5);
        }
    }

    #[test]
    fn gradients_on_both_ways() {
        let device = Device::flex().autodiff();
        let x = features([1, 2, 6, 3], 1, &device);
        for layer in [VectorLayer::Vn, VectorLayer::So2] {
            let block = block(layer, &device);
            assert_gradients(block.clone(), x.clone(), VectorFeedForward::forward_factors);
            assert_gradients(block, x.clone(), |b, x| b.forward_folded(x, &b.fold()));
        }
    }

    #[test]
    fn few_rows_are_not_folded() {
        let device = Device::flex();
        let block = block(VectorLayer::Vn, &device);
        assert!(!block.folding_pays(&features([1, 1, 3, 3], 1, &device)));
        assert!(block.folding_pays(&features([1, 2, 6, 3], 1, &device)));
    }
}
