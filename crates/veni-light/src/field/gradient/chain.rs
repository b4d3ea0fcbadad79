//! From the folded latent back to the latent: the attention's linear maps and the invariants, once. MODEL (39, 40).

use super::Gradient;
use super::backward::Sums;
use crate::field::Folded;
use crate::field::weights::{Affine, Weights};

/// The gradient with respect to the latent, from the gradients with respect to what conditioning left of it.
pub(super) fn to_latent(weights: &Weights, folded: &Folded, sums: &Sums) -> Gradient {
    let n = weights.latent_vectors;
    let mut condition = vec![0.0f64; 3 * n];
    // the first layer's attention is added before it, every other one by the layer before
    let added = sums.added.chunks_exact(weights.mlp.hidden);
    for (layer, gradient) in weights.attention.iter().zip(added) {
        let inner = back(&layer.out, gradient);
        for (sum, value) in condition.iter_mut().zip(back(&layer.value, &inner)) {
            *sum += value;
        }
    }
    let vectors = (folded.vectors.iter().zip(&sums.vectors).zip(condition.as_chunks::<3>().0)).map(
        |(([x, y], [dx, dy]), [a, b, z])| {
            let (x, y) = (f64::from(*x), f64::from(*y));
            let [p, q] = weights.invariant.derivative(x.hypot(y));
            let radial = a * p + b * q;
            [(dx + radial * x) as f32, (dy + radial * y) as f32, *z as f32]
        },
    );
    Gradient { loss: sums.loss, vectors: vectors.collect(), log_exposure: sums.log_exposure as f32 }
}

/// Wᵀ applied to a gradient, W being [in, out].
fn back(layer: &Affine, gradient: &[f64]) -> Vec<f64> {
    let rows = layer.weight.chunks_exact(layer.bias.len());
    rows.map(|row| row.iter().zip(gradient).map(|(w, g)| f64::from(*w) * g).sum()).collect()
}
