//! Multi-head self-attention among tokens of vectors. MODEL (9).

use super::norm::COORDINATE;
use super::{VectorLinear, VectorLinearConfig};
use burn::module::Module;
use burn::tensor::activation::softmax;
use burn::tensor::{Bool, Device, Tensor};
use veni_light::model::VectorLayer;
use veni_light::random::Stream;

/// Sizes of a [`VectorAttention`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorAttentionConfig {
    /// Kind of its four linear maps.
    pub layer: VectorLayer,
    /// Channels of a token, in and out.
    pub channels: usize,
    /// Heads.
    pub heads: usize,
    /// Channels of one head.
    pub head_channels: usize,
    /// Coordinates of a channel.
    pub coordinates: usize,
}

/// softmax(⟨q_t, k_s⟩ / √(head channels · coordinates)) over tokens s, applied to v_s, per head.
///
/// q, k, v are vector features; the product runs over all channels and coordinates of a head, so the weights
/// are invariant and the output rotates with the input. With [`VectorLayer::Vn`] this is Vector-Neuron attention
/// (equivariant under every orthogonal map of the coordinates), with [`VectorLayer::So2`] SO(2) attention.
#[derive(Module, Debug)]
pub struct VectorAttention {
    /// Channels to heads · head channels.
    pub query: VectorLinear,
    /// Channels to heads · head channels.
    pub key: VectorLinear,
    /// Channels to heads · head channels.
    pub value: VectorLinear,
    /// Heads · head channels back to channels.
    pub out: VectorLinear,
    /// Heads.
    pub heads: usize,
}

impl VectorAttentionConfig {
    /// Draws the weights.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> VectorAttention {
        let Self { layer, channels, heads, head_channels, coordinates } = *self;
        let inner = heads * head_channels;
        let into = VectorLinearConfig::new(layer, channels, inner, coordinates);
        VectorAttention {
            query: into.init(rng, device),
            key: into.init(rng, device),
            value: into.init(rng, device),
            out: VectorLinearConfig::new(layer, inner, channels, coordinates).init(rng, device),
            heads,
        }
    }
}

impl VectorAttention {
    /// Lets every token look at every token.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinate, channel]`
    /// - `keep`: `[batch, token]`, true for tokens that may be looked at; `None` is all
    /// - output: as `x`
    pub fn forward(&self, x: Tensor<4>, keep: Option<Tensor<2, Bool>>) -> Tensor<4> {
        self.forward_from(x.clone(), x, keep)
    }

    /// Lets the tokens `from` look at the tokens `x`.
    ///
    /// # Shapes
    /// - `from`: `[batch, looking token, coordinate, channel]`
    /// - `x`: `[batch, token, coordinate, channel]`
    /// - `keep`: `[batch, token]`, true for tokens that may be looked at; `None` is all
    /// - output: as `from`
    pub fn forward_from(&self, from: Tensor<4>, x: Tensor<4>, keep: Option<Tensor<2, Bool>>) -> Tensor<4> {
        let coordinates = x.dims()[COORDINATE];
        let q = self.split_heads(self.query.forward(from));
        let k = self.split_heads(self.key.forward(x.clone()));
        let v = self.split_heads(self.value.forward(x));
        let [batch, heads, tokens, width] = k.dims();
        let mut logits = q.matmul(k.transpose()) * (1.0 / (width as f64).sqrt());
        if let Some(keep) = keep {
            let looking = logits.dims()[2];
            let hidden =
                keep.bool_not().reshape([batch, 1, 1, tokens]).expand([batch, heads, looking, tokens]);
            // Finite, so that a row without any kept token stays finite too.
            logits = logits.mask_fill(hidden, f32::MIN);
        }
        self.out.forward(self.join_heads(softmax(logits, 3).matmul(v), coordinates))
    }

    /// `[batch, token, coordinate, heads · h]` to `[batch, heads, token, coordinate · h]`.
    fn split_heads(&self, x: Tensor<4>) -> Tensor<4> {
        let [batch, tokens, coordinates, inner] = x.dims();
        let head = inner / self.heads;
        x.reshape([batch, tokens, coordinates, self.heads, head]).permute([0, 3, 1, 2, 4]).reshape([
            batch,
            self.heads,
            tokens,
            coordinates * head,
        ])
    }

    /// The inverse of [`split_heads`](Self::split_heads).
    fn join_heads(&self, x: Tensor<4>, coordinates: usize) -> Tensor<4> {
        let [batch, heads, tokens, width] = x.dims();
        let head = width / coordinates;
        x.reshape([batch, heads, tokens, coordinates, head]).permute([0, 2, 3, 1, 4]).reshape([
            batch,
            tokens,
            coordinates,
            heads * head,
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{assert_gradients, features, max_difference, rng, rotate_xy};

    fn config(layer: VectorLayer) -> VectorAttentionConfig {
        VectorAttentionConfig { layer, channels: 4, heads: 2, head_channels: 3, coordinates: 6 }
    }

    #[test]
    fn rotates_with_its_input_and_forgets_the_order_of_tokens() {
        let device = Device::flex();
        let x = features([2, 3, 6, 4], 1, &device);
        for layer in [VectorLayer::Vn, VectorLayer::So2] {
            let attention = config(layer).init(&mut rng(2), &device);
            let y = attention.forward(x.clone(), None);
            let rotated = attention.forward(rotate_xy(x.clone(), 1.1), None);
            assert!(max_difference(rotated, rotate_xy(y.clone(), 1.1)) < 1e-5);
            let flipped = attention.forward(x.clone().flip([1]), None);
            assert!(max_difference(flipped, y.flip([1])) < 1e-5);
        }
    }

    #[test]
    fn hidden_tokens_do_not_matter() {
        let device = Device::flex();
        let attention = config(VectorLayer::Vn).init(&mut rng(2), &device);
        let x = features([1, 3, 6, 4], 1, &device);
        let other = Tensor::cat(vec![x.clone().narrow(1, 0, 2), features([1, 1, 6, 4], 9, &device)], 1);
        let keep = Tensor::<2, Bool>::from_data([[true, true, false]], &device);
        let first = |x: Tensor<4>, keep| attention.forward(x, keep).narrow(1, 0, 2);
        assert_eq!(
            max_difference(first(x.clone(), Some(keep.clone())), first(other.clone(), Some(keep))),
            0.0
        );
        assert!(max_difference(first(x, None), first(other, None)) > 1e-3);
    }

    #[test]
    fn gradients() {
        let device = Device::flex().autodiff();
        for layer in [VectorLayer::Vn, VectorLayer::So2] {
            let attention = config(layer).init(&mut rng(3), &device);
            assert_gradients(attention, features([1, 3, 6, 4], 4, &device), |a, x| a.forward(x, None));
        }
    }
}
