//! The residual layers. MODEL (19).

use super::linear::Linear;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, activation::relu, module};
use veni_light::random::Stream;

/// Added to the variance before its square root.
const EPSILON: f64 = 1e-5;

/// Gain and offset of a layer norm, each `[h]`.
#[derive(Module, Debug)]
pub struct Norm {
    /// γ.
    pub gamma: Param<Tensor<1>>,
    /// β.
    pub beta: Param<Tensor<1>>,
}

impl Norm {
    /// γ = 1, β = 0.
    pub fn new(width: usize, device: &Device) -> Self {
        Self {
            gamma: Param::from_tensor(Tensor::ones([width], device)),
            beta: Param::from_tensor(Tensor::zeros([width], device)),
        }
    }

    /// Weight and bias of `next` applied to γ x̂ + β, as a map of the normalised x̂ itself:
    /// (diag(γ) W, β W + b). Moves two passes over all directions into the weights.
    pub(super) fn fold(&self, next: &Linear) -> (Tensor<2>, Tensor<1>) {
        let weight = next.weight.val();
        let bias = self.beta.val().unsqueeze::<2>().matmul(weight.clone()).squeeze_dim(0) + next.bias.val();
        (self.gamma.val().unsqueeze_dim(1) * weight, bias)
    }
}

/// One layer of the field: x ← LN(att + x), x ← LN(FF(x) + x) with FF = linear, ReLU, linear.
///
/// The official attention has one key, so its softmax is 1 and att = out(value(c)) whatever the direction:
/// one vector per image. Its query and key weights never act and do not exist here.
#[derive(Module, Debug)]
pub struct Layer {
    /// The attention's value projection, `[3N, h]`.
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
}

impl Layer {
    /// A layer of width `hidden` conditioned on D = 3N = `condition` features.
    pub fn new(condition: usize, hidden: usize, rng: &mut Stream, device: &Device) -> Self {
        Self {
            value: Linear::new(condition, hidden, rng, device),
            out: Linear::new(hidden, hidden, rng, device),
            norm1: Norm::new(hidden, device),
            ff1: Linear::new(hidden, hidden, rng, device),
            ff2: Linear::new(hidden, hidden, rng, device),
            norm2: Norm::new(hidden, device),
        }
    }

    /// The attention output, once per image: conditioning `[B, 3N]` → `[B, h]`.
    pub fn attention(&self, condition: Tensor<2>) -> Tensor<2> {
        self.out.forward(self.value.forward(condition))
    }

    /// x + att `[B, R, h]` → x̂ `[B, R, h]`, whose γ₂ x̂ + β₂ is the layer's output.
    pub(super) fn forward(&self, x: Tensor<3>) -> Tensor<3> {
        perceptron(x, &self.norm1, &self.ff1, &self.ff2)
    }

    /// The input of the layer after this one: γ₂ x̂ + (β₂ + that layer's attention output `[B, h]`).
    pub(super) fn next_input(&self, x: Tensor<3>, attention: Tensor<2>) -> Tensor<3> {
        let offset = attention + self.norm2.beta.val().unsqueeze();
        x * self.norm2.gamma.val().unsqueeze() + offset.unsqueeze_dim(1)
    }

    /// The final linear map of γ₂ x̂ + β₂.
    pub(super) fn read_out(&self, x: Tensor<3>, output: &Linear) -> Tensor<3> {
        let (weight, bias) = self.norm2.fold(output);
        module::linear(x, weight, Some(bias))
    }
}

/// What follows the attention: with y = LN₁(x + att), x + att `[B, R, h]` → the normalised y + FF(y) `[B, R, h]`,
/// without γ₂ and β₂.
pub(super) fn perceptron(x: Tensor<3>, norm1: &Norm, ff1: &Linear, ff2: &Linear) -> Tensor<3> {
    let x = normalise(x);
    let (weight, bias) = norm1.fold(ff1);
    let hidden = relu(module::linear(x.clone(), weight, Some(bias)));
    // γ₁ x̂ + FF: the offset β₁ joins the bias of the second map.
    let bias = ff2.bias.val() + norm1.beta.val();
    let branch = module::linear(hidden, ff2.weight.val(), Some(bias));
    normalise(branch + x * norm1.gamma.val().unsqueeze())
}

/// (x − mean)/√(variance + ε) over the last axis; biased variance.
fn normalise(x: Tensor<3>) -> Tensor<3> {
    let mean = x.clone().mean_dim(2);
    let x = x - mean;
    let variance = (x.clone() * x.clone()).mean_dim(2);
    // A product with the small reciprocal: its backward pass is cheaper than a quotient's.
    x * (variance + EPSILON).sqrt().recip()
}
