//! Attention over the latent vectors: each is a token, and a ray asks for what it needs. MODEL (23).
//!
//! RENI++'s decoder has one key per ray and therefore no attention. Here the keys and values are those of the N latent
//! vectors, made from their invariants: they do not depend on the ray and are computed once per latent. Queries are
//! the ray's features, which know the direction only through invariants, so the whole is as equivariant as they are.

use super::layer::{Norm, perceptron};
use super::linear::Linear;
use crate::nn::uniform;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, activation::softmax};
use veni_light::random::Stream;

/// Invariants of a latent vector to its token: t_i = x_i W + b_i. The bias is the vector's own, which tells the N
/// vectors apart.
#[derive(Module, Debug)]
pub struct Tokens {
    /// W, [C/N, h].
    pub weight: Param<Tensor<2>>,
    /// b, [N, h].
    pub bias: Param<Tensor<2>>,
}

impl Tokens {
    /// Weights uniform in ±1/√inputs, biases in ±1.
    pub fn new(tokens: usize, inputs: usize, hidden: usize, rng: &mut Stream, device: &Device) -> Self {
        Self {
            weight: uniform([inputs, hidden], 1.0 / (inputs as f64).sqrt(), rng, device),
            bias: uniform([tokens, hidden], 1.0, rng, device),
        }
    }

    /// [B, N, C/N] → [B, N, h].
    pub fn forward(&self, features: Tensor<3>) -> Tensor<3> {
        features.matmul(self.weight.val().unsqueeze()) + self.bias.val().unsqueeze()
    }
}

/// x ← LN(att(x) + x), x ← LN(FF(x) + x) with multi-head attention att(x) of the rays over the tokens.
#[derive(Module, Debug)]
pub struct TokenLayer {
    /// Of the ray's features, `[h, h]`.
    pub query: Linear,
    /// Of the tokens, `[h, h]`.
    pub key: Linear,
    /// Of the tokens, `[h, h]`.
    pub value: Linear,
    /// The attention's output projection, `[h, h]`.
    pub out: Linear,
    /// The norm after the attention.
    pub norm1: Norm,
    /// First feed-forward map, `[h, h]`.
    pub ff1: Linear,
    /// Second feed-forward map, `[h, h]`.
    pub ff2: Linear,
    /// The norm after the feed-forward.
    pub norm2: Norm,
    heads: usize,
}

/// What a layer's attention keeps of one latent; the same for every ray. The heads stand side by side, so that all of them
/// are one matrix product.
#[derive(Clone, Debug)]
pub struct Memory {
    /// Wq Kᵀ/√(h/heads), a query map folded with the keys: [B, h, heads·N].
    weight: Tensor<3>,
    /// bq Kᵀ/√(h/heads) [B, 1, heads·N].
    bias: Tensor<3>,
    /// V Wout, the values after the output projection: [B, heads·N, h].
    values: Tensor<3>,
}

impl TokenLayer {
    /// A layer of width `hidden`, which `heads` divides.
    pub fn new(hidden: usize, heads: usize, rng: &mut Stream, device: &Device) -> Self {
        let mut square = || Linear::new(hidden, hidden, rng, device);
        let [query, key, value, out] = [square(), square(), square(), square()];
        let (ff1, ff2) = (square(), square());
        let norm = || Norm::new(hidden, device);
        Self { query, key, value, out, norm1: norm(), ff1, ff2, norm2: norm(), heads }
    }

    /// Keys and values of the tokens [B, N, h], folded into the maps that stand before and after them.
    pub fn remember(&self, tokens: Tensor<3>) -> Memory {
        let [batch, n, hidden] = tokens.dims();
        let (heads, width) = (self.heads, hidden / self.heads);
        let split = |x: Tensor<3>| x.reshape([batch, n, heads, width]).swap_dims(1, 2);
        let keys = split(self.key.forward(tokens.clone())).swap_dims(2, 3) * (width as f64).sqrt().recip();
        let by_head = |x: Tensor<2>| {
            let [rows, _] = x.dims();
            x.reshape([rows, heads, width]).swap_dims(0, 1).unsqueeze::<4>()
        };
        // [B, heads, rows, N] → [B, rows, heads·N]
        let side_by_side = |x: Tensor<4>| {
            let [batch, _, rows, _] = x.dims();
            x.swap_dims(1, 2).reshape([batch, rows, heads * n])
        };
        let output = self.out.weight.val().reshape([1, heads, width, hidden]);
        Memory {
            weight: side_by_side(by_head(self.query.weight.val()).matmul(keys.clone())),
            bias: side_by_side(by_head(self.query.bias.val().unsqueeze()).matmul(keys)),
            values: split(self.value.forward(tokens)).matmul(output).reshape([batch, heads * n, hidden]),
        }
    }

    /// Features of the rays [B, R, h] → x̂ [B, R, h], whose γ₂ x̂ + β₂ is the layer's output.
    pub(super) fn forward(&self, x: Tensor<3>, memory: Memory) -> Tensor<3> {
        let logits = x.clone().matmul(memory.weight) + memory.bias;
        let [batch, rays, all] = logits.dims();
        let by_head = logits.reshape([batch, rays, self.heads, all / self.heads]);
        let shares = softmax(by_head, 3).reshape([batch, rays, all]);
        // each head adds its part; together they are out(concatenated heads)
        let attention = shares.matmul(memory.values) + self.out.bias.val().unsqueeze();
        perceptron(x + attention, &self.norm1, &self.ff1, &self.ff2)
    }

    /// γ₂ x̂ + β₂.
    pub(super) fn output(&self, x: Tensor<3>) -> Tensor<3> {
        x * self.norm2.gamma.val().unsqueeze() + self.norm2.beta.val().unsqueeze()
    }
}
