//! Kullback–Leibler divergence from the standard normal prior. MODEL (26, 32).

use burn::tensor::Tensor;

/// Of isotropic Gaussians in R³, one variance e^l per latent vector (so equivariant under rotation):
/// −½(3 + 3l − |μ|² − 3e^l), averaged over the vectors. μ `[B, N, 3]`, l `[B, N, 1]` → `[B]`.
pub fn isotropic(mean: Tensor<3>, log_variance: Tensor<3>) -> Tensor<1> {
    let square = (mean.clone() * mean).sum_dim(2);
    let divergence = (square - 3.0 - log_variance.clone() * 3.0 + log_variance.exp() * 3.0) * 0.5;
    divergence.mean_dim(1).flatten(0, 2)
}

/// RENI++'s: a variance for every coordinate; −½(1 + l − μ² − e^l) summed over everything, divided by N.
/// μ, l `[B, N, 3]` → `[1]`.
pub fn per_coordinate(mean: Tensor<3>, log_variance: Tensor<3>) -> Tensor<1> {
    let n = mean.dims()[1] as f64;
    ((mean.clone() * mean) - 1.0 - log_variance.clone() + log_variance.exp()).sum() * (0.5 / n)
}
