//! Axes and sharpnesses as free numbers, and what a loss says about them. MODEL (51, 52).

use veni_light::vector::{dot, length, unit};

/// Free numbers per lobe: a vector along the axis, of any length, and ln λ.
pub(super) const FREE: usize = 4;

/// Unit axes and sharpnesses.
pub(super) fn lobes(x: &[f64]) -> impl Iterator<Item = ([f64; 3], f64)> {
    x.chunks_exact(FREE).map(|v| (unit([v[0], v[1], v[2]]), v[3].exp()))
}

/// The lobes e^{λ(⟨μ,d⟩ − 1)} at every direction and a last column of ones, `[directions, lobes + 1]`.
pub(super) fn matrix(x: &[f64], directions: &[[f64; 3]]) -> Vec<f64> {
    let lobes: Vec<_> = lobes(x).collect();
    let mut out = Vec::with_capacity((lobes.len() + 1) * directions.len());
    for d in directions {
        out.extend(lobes.iter().map(|(axis, sharpness)| (sharpness * (dot(*axis, *d) - 1.0)).exp()));
        out.push(1.0);
    }
    out
}

/// The gradient in the free numbers, given `pull` `[directions, lobes]`, the loss's derivative in the logarithm of a
/// lobe's value: ∂/∂ln λ = Σ pull·λ(⟨μ,d⟩ − 1), ∂/∂μ = Σ pull·λ d, the latter through μ = v/|v|.
pub(super) fn gradient(x: &[f64], directions: &[[f64; 3]], pull: &[f64]) -> Vec<f64> {
    let lobes: Vec<_> = lobes(x).collect();
    let mut sums = vec![[0.0; 4]; lobes.len()];
    for (d, pull) in directions.iter().zip(pull.chunks_exact(lobes.len().max(1))) {
        for (sum, p) in sums.iter_mut().zip(pull) {
            sum[0] += p * d[0];
            sum[1] += p * d[1];
            sum[2] += p * d[2];
            sum[3] += p;
        }
    }
    let mut out = Vec::with_capacity(x.len());
    for ((v, (axis, sharpness)), [gx, gy, gz, total]) in x.chunks_exact(FREE).zip(&lobes).zip(sums) {
        let along = dot(*axis, [gx, gy, gz]);
        let length = length([v[0], v[1], v[2]]);
        out.extend([gx, gy, gz].iter().zip(axis).map(|(g, a)| sharpness * (g - along * a) / length));
        out.push(sharpness * (along - total));
    }
    out
}
