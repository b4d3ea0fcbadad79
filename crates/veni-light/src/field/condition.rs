//! From a latent to the vectors that the layers add. MODEL (17).
//!
//! The attention has one key, so its softmax is 1 and it returns out(value(c)) whatever the direction, where
//! c = (a₁₁, a₁₂, z₁, …, a_N1, a_N2, z_N) are the latent's invariants. One h-vector per layer is all that is
//! left of it.

use super::weights::{Affine, Invariant, Weights};
use crate::latent::Latent;
use crate::model::VnReluForm;

impl Invariant {
    /// VN-invariant(1, 2) of y = w·(x, y) with |(x, y)| = r. All its vectors are parallel to y, so with
    /// α = W a₀ and β = U a₀ the VN-ReLU leaves αₑ y where αₑβₑ ≥ 0, and its inner product with y is
    /// w² αₑ r². Elsewhere the projection leaves nothing; the reference forms leave 1 − |w βₑ| r of it.
    fn apply(&self, r: f64) -> [f32; 2] {
        let w = self.scale;
        std::array::from_fn(|e| {
            let (alpha, beta) = (self.alpha[e], self.beta[e]);
            let k = (w * beta * r).abs();
            let left = match self.form {
                _ if alpha * beta >= 0.0 => 1.0,
                VnReluForm::Projection => 0.0,
                VnReluForm::Reference => 1.0 - k * k / k.max(1e-3),
                VnReluForm::ReferenceNormGuard => 1.0 - k * k / k.max(1e-6),
            };
            (w * w * alpha * r * r * left) as f32
        })
    }

    /// (1/r) daₑ/dr: what a gradient with respect to aₑ is multiplied by, along with x and y, to be one by x and y.
    /// Smooth at r = 0. Below the guard of the reference forms |k| counts as a constant, as there.
    #[cfg(feature = "gradients")]
    pub(super) fn derivative(&self, r: f64) -> [f64; 2] {
        let w = self.scale;
        std::array::from_fn(|e| {
            let (alpha, beta) = (self.alpha[e], self.beta[e]);
            let k = (w * beta * r).abs();
            let below = |guard: f64| if k > guard { 2.0 - 3.0 * k } else { 2.0 - 4.0 * k * k / guard };
            let left = match self.form {
                _ if alpha * beta >= 0.0 => 2.0,
                VnReluForm::Projection => 0.0,
                VnReluForm::Reference => below(1e-3),
                VnReluForm::ReferenceNormGuard => below(1e-6),
            };
            w * w * alpha * left
        })
    }
}

/// out(value(c)) of every layer.
pub(super) fn attention(weights: &Weights, latent: &Latent) -> Vec<Vec<f32>> {
    let invariants = |[x, y, z]: &[f32; 3]| {
        let [a, b] = weights.invariant.apply(f64::from(*x).hypot(f64::from(*y)));
        [a, b, *z]
    };
    let c: Vec<f32> = latent.vectors.iter().flat_map(invariants).collect();
    // compiled for the widest registers of the machine
    pulp::Arch::new().dispatch(|| {
        let attention = weights.attention.iter();
        attention.map(|layer| affine(&layer.out, &affine(&layer.value, &c))).collect()
    })
}

#[inline(always)]
fn affine(layer: &Affine, x: &[f32]) -> Vec<f32> {
    let mut y = layer.bias.clone();
    for (x, row) in x.iter().zip(layer.weight.chunks_exact(y.len())) {
        for (y, w) in y.iter_mut().zip(row) {
            *y += x * w;
        }
    }
    y
}
