//! The transformer encoder of vector features. MODEL (11).

use super::{
    GateWeights, VectorAttention, VectorAttentionConfig, VectorFeedForward, VectorFeedForwardConfig,
    VnLayerNorm, VnLayerNormConfig,
};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use veni_light::model::{VectorLayer, VnReluForm};
use veni_light::random::Stream;

/// Sizes of a [`VectorTransformer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorTransformerConfig {
    /// Kind of all linear maps.
    pub layer: VectorLayer,
    /// Blocks.
    pub depth: usize,
    /// Channels of a token.
    pub channels: usize,
    /// Attention heads.
    pub heads: usize,
    /// Channels of one head.
    pub head_channels: usize,
    /// Feed-forward expansion.
    pub expansion: usize,
    /// Coordinates of a channel.
    pub coordinates: usize,
    /// Form of the ReLUs.
    pub form: VnReluForm,
    /// Whether a layer norm follows the last block.
    pub final_norm: bool,
}

/// X ← X + LN(Attention(X)), then X ← X + LN(FeedForward(X)): each branch's output is normalised, not its input.
#[derive(Module, Debug)]
pub struct VectorBlock {
    /// Attention among tokens.
    pub attention: VectorAttention,
    /// Norm of the attention's output.
    pub norm1: VnLayerNorm,
    /// Feed-forward within a token.
    pub feed_forward: VectorFeedForward,
    /// Norm of the feed-forward's output.
    pub norm2: VnLayerNorm,
}

/// A chain of [`VectorBlock`]s; commutes with rotations of x and y, and with the order of tokens.
#[derive(Module, Debug)]
pub struct VectorTransformer {
    /// The blocks.
    pub layers: Vec<VectorBlock>,
    /// Applied to the last block's output.
    pub norm: Option<VnLayerNorm>,
}

/// Every block's [`GateWeights`], for inference with weights that no longer change.
#[derive(Clone, Debug)]
pub struct FoldedGates(Vec<GateWeights>);

impl VectorTransformerConfig {
    /// Draws the weights.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> VectorTransformer {
        let Self { layer, depth, channels, heads, head_channels, expansion, coordinates, form, final_norm } =
            *self;
        let attention = VectorAttentionConfig { layer, channels, heads, head_channels, coordinates };
        let feed_forward = VectorFeedForwardConfig { layer, channels, expansion, coordinates, form };
        let norm = VnLayerNormConfig { channels };
        VectorTransformer {
            layers: (0..depth)
                .map(|_| VectorBlock {
                    attention: attention.init(rng, device),
                    norm1: norm.init(device),
                    feed_forward: feed_forward.init(rng, device),
                    norm2: norm.init(device),
                })
                .collect(),
            norm: final_norm.then(|| norm.init(device)),
        }
    }
}

impl VectorBlock {
    /// Applies the block; with `first_only` the first token alone is computed, which looks at all of them.
    fn forward(&self, x: Tensor<4>, first_only: bool, gates: Option<&GateWeights>) -> Tensor<4> {
        let attended = if first_only {
            let first = x.clone().narrow(1, 0, 1);
            let seen = self.attention.forward_from(first.clone(), x, None);
            first + self.norm1.forward(seen)
        } else {
            x.clone() + self.norm1.forward(self.attention.forward(x, None))
        };
        let fed = match gates {
            Some(gates) => self.feed_forward.forward_folded(attended.clone(), gates),
            None => self.feed_forward.forward(attended.clone()),
        };
        attended + self.norm2.forward(fed)
    }
}

impl VectorTransformer {
    /// Applies all blocks.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinate, channel]`
    /// - output: the same
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        self.run(x, false, None)
    }

    /// The products of weights of all blocks; valid until a weight changes.
    pub fn fold(&self) -> FoldedGates {
        FoldedGates(self.layers.iter().map(|block| block.feed_forward.fold()).collect())
    }

    /// [`forward`](Self::forward), with folded products if given. With `first_only` only its first token, and the last block
    /// computes no other.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinate, channel]`
    /// - output: the same, or `[batch, 1, coordinate, channel]`
    pub fn run(&self, mut x: Tensor<4>, first_only: bool, folded: Option<&FoldedGates>) -> Tensor<4> {
        for (index, block) in self.layers.iter().enumerate() {
            let last = index + 1 == self.layers.len();
            x = block.forward(x, first_only && last, folded.map(|gates| &gates.0[index]));
        }
        if first_only && self.layers.is_empty() {
            x = x.narrow(1, 0, 1);
        }
        match &self.norm {
            Some(norm) => norm.forward(x),
            None => x,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, rng, rotate_xy};

    fn config(layer: VectorLayer) -> VectorTransformerConfig {
        VectorTransformerConfig {
            layer,
            depth: 2,
            channels: 4,
            heads: 2,
            head_channels: 2,
            expansion: 2,
            coordinates: 3,
            form: VnReluForm::Projection,
            final_norm: true,
        }
    }

    #[test]
    fn first_token_alone_is_the_first_token_of_all() {
        let device = Device::flex();
        let x = features([2, 3, 3, 4], 1, &device);
        for layer in [VectorLayer::Vn, VectorLayer::So2] {
            let transformer = config(layer).init(&mut rng(2), &device);
            let all = transformer.forward(x.clone());
            let first = all.clone().narrow(1, 0, 1);
            assert!(max_difference(transformer.run(x.clone(), true, None), first.clone()) < 1e-5);
            let folded = transformer.fold();
            assert!(max_difference(transformer.run(x.clone(), true, Some(&folded)), first) < 1e-5);
            assert!(
                max_difference(transformer.forward(rotate_xy(x.clone(), 0.3)), rotate_xy(all, 0.3)) < 1e-5
            );
        }
        let none = VectorTransformerConfig { depth: 0, ..config(VectorLayer::Vn) }.init(&mut rng(2), &device);
        assert_eq!(none.run(x, true, None).dims(), [2, 1, 3, 4]);
    }

    #[test]
    fn gradients() {
        let device = Device::flex().autodiff();
        for layer in [VectorLayer::Vn, VectorLayer::So2] {
            let transformer = config(layer).init(&mut rng(3), &device);
            let first = |transformer: &VectorTransformer, x| transformer.run(x, true, None);
            assert_gradients(transformer, features([1, 3, 3, 4], 4, &device), first);
        }
    }
}
