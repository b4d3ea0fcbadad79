//! Colour direction: one minus the cosine between predicted and true RGB. MODEL (28).

use burn::tensor::Tensor;

/// 1 − average over the sphere of cos(e^P, e^I), the angle between linear RGB vectors: the chromaticity
/// error, blind to any brightness factor, even one per pixel. This is what the paper describes; it takes
/// the cosine of *log* RGB, as [`reference()`] does, which is neither. `[B, H, W, 3]` → `[1]`.
pub fn chromaticity(prediction: Tensor<4>, target: Tensor<4>, weights: Tensor<4>) -> Tensor<1> {
    let (p, i) = (linear(prediction), linear(target));
    let product = (p.clone() * i.clone()).sum_dim(3);
    let lengths = ((p.clone() * p).sum_dim(3) * (i.clone() * i).sum_dim(3)).sqrt();
    ((product / lengths).neg() + 1.0).mul(weights).mean()
}

/// Linear radiance divided by its largest channel: no overflow, and a length of at least 1.
fn linear(log_radiance: Tensor<4>) -> Tensor<4> {
    let largest = log_radiance.clone().detach().max_dim(3);
    (log_radiance - largest).exp()
}

/// The reference implementation's form: mean over pixels of 1 − mask·cos(P, I) of the log values, ε = 1e-8 on the product of
/// the lengths. `[B, H, W, 3]` → `[1]`.
pub fn reference(prediction: Tensor<4>, target: Tensor<4>, mask: Tensor<4>) -> Tensor<1> {
    ((cosine(prediction, target) * mask).neg() + 1.0).mean()
}

/// RENI++'s form: mean over rays of 1 − cos(P, I) of the log values. [.., 3] → `[1]`.
pub fn rays<const D: usize>(prediction: Tensor<D>, target: Tensor<D>) -> Tensor<1> {
    (cosine(prediction, target).neg() + 1.0).mean()
}

/// Cosine over the last axis, [.., 3] → [.., 1]. The guard is inside the root: its gradient stays finite.
fn cosine<const D: usize>(a: Tensor<D>, b: Tensor<D>) -> Tensor<D> {
    const EPSILON: f64 = 1e-8;
    let lengths = (a.clone() * a.clone()).sum_dim(D - 1) * (b.clone() * b.clone()).sum_dim(D - 1);
    (a * b).sum_dim(D - 1) / lengths.clamp_min(EPSILON * EPSILON).sqrt()
}
