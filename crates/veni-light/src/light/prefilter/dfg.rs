//! The table of the split-sum approximation: how much of uniform light a GGX surface reflects.
//!
//! With height-correlated Smith visibility and F = f0 + (1 − f0)(1 − v·h)⁵, a surface of roughness p seen at cosine μ reflects
//! A f0 + B. The table stores (B, A + B): `mix(x, y, f0)` is the reflectance, and y is what a white mirror of that roughness
//! reflects, 1 less what single scattering loses.

use std::f64::consts::PI;

use crate::light::quadrature::gauss_legendre;
use crate::tasks;

/// A square table: columns are μ = (i + ½)/n, rows perceptual roughness (j + ½)/n.
#[derive(Clone, Debug, PartialEq)]
pub struct Dfg {
    size: usize,
    values: Vec<[f32; 2]>,
}

impl Dfg {
    /// A table of `size` × `size`.
    pub fn new(size: usize) -> Self {
        let (radial, around) = (gauss_legendre(48), gauss_legendre(24));
        let rows = tasks::map(
            0..size,
            || (),
            |(), j| {
                let at = |k: usize| (k as f64 + 0.5) / size as f64;
                (0..size).map(|i| reflected(at(i), at(j), &radial, &around)).collect::<Vec<_>>()
            },
        );
        Self { size, values: rows.into_iter().flatten().collect() }
    }

    /// Entries along a side.
    pub fn size(&self) -> usize {
        self.size
    }

    /// (B, A + B), row by row.
    pub fn values(&self) -> &[[f32; 2]] {
        &self.values
    }
}

/// Sums over half vectors drawn by D(h) n·h: tan² θ = α² ξ / (1 − ξ), Gauss points in ξ and azimuth.
fn reflected(mu: f64, p: f64, radial: &[(f64, f64)], around: &[(f64, f64)]) -> [f32; 2] {
    let square = (p * p).powi(2);
    let view = [(1.0 - mu * mu).sqrt(), mu];
    let (mut scaled, mut whole) = (0.0, 0.0);
    for (x, w) in radial {
        // ξ = 1 − (1 − u)²: denser towards grazing half vectors, where the integrand is steep
        let u = 0.5 * (1.0 + x);
        let xi = u * (2.0 - u);
        let density = 0.5 * w * 2.0 * (1.0 - u);
        let cos2 = (1.0 - xi) / (1.0 + (square - 1.0) * xi);
        let (cos, sin) = (cos2.sqrt(), (1.0 - cos2).max(0.0).sqrt());
        for (y, v) in around {
            let phi = 0.5 * PI * (1.0 + y);
            let vh = view[0] * sin * phi.cos() + view[1] * cos;
            let nl = 2.0 * vh * cos - mu;
            if nl <= 0.0 || vh <= 0.0 {
                continue;
            }
            let lambda = |a: f64, b: f64| a * (b * b * (1.0 - square) + square).sqrt();
            let visibility = 0.5 / (lambda(nl, mu) + lambda(mu, nl));
            // ∫ D V F n·l dl = ∫ (D n·h dh) · 4 V F n·l v·h / n·h
            let value = 0.5 * v * density * 4.0 * visibility * nl * vh / cos;
            scaled += value * (1.0 - vh).powi(5);
            whole += value;
        }
    }
    [scaled as f32, whole as f32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_that_of_a_fine_sum() {
        let table = Dfg::new(16);
        for j in [2, 5, 8, 15] {
            for i in [1, 4, 9, 15] {
                let at = |k: usize| (k as f64 + 0.5) / 16.0;
                let rule = gauss_legendre(512);
                let fine = reflected(at(i), at(j), &rule, &rule);
                let found = table.values()[j * 16 + i];
                for (a, b) in found.into_iter().zip(fine) {
                    assert!((a - b).abs() < 1e-3, "row {j}, column {i}: {found:?} for {fine:?}");
                }
            }
        }
    }

    /// Seen along the normal, a smooth surface reflects everything, and none reflects more than it gets.
    #[test]
    fn nothing_is_gained() {
        let table = Dfg::new(32);
        assert!(table.values().iter().all(|[b, whole]| *b >= 0.0 && b < whole && *whole <= 1.0005));
        let [b, whole] = table.values()[31];
        assert!((whole - 1.0).abs() < 1e-3 && b < 1e-3, "{b} {whole}");
        // the roughest surface, seen along its normal: ½ ∫ 2t / (1 + t) dt = 1 − ln 2
        let rule = gauss_legendre(64);
        let [_, rough] = reflected(1.0 - 1e-12, 1.0, &rule, &rule);
        assert!((f64::from(rough) - (1.0 - 2f64.ln())).abs() < 1e-3, "{rough}");
    }
}
