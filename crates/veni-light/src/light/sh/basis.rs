//! The real orthonormal spherical-harmonics basis. MODEL (49).

use std::f64::consts::{PI, SQRT_2};

/// The functions Y_lm for l = 0 … `order`, m = −l … l, at index l² + l + m:
///
/// Y_lm = K_lm P_l|m|(cos θ) · {√2 cos mφ for m > 0; 1 for m = 0; √2 sin |m|φ for m < 0},
/// K_lm = √((2l+1)/4π · (l−|m|)!/(l+|m|)!), P with the Condon–Shortley sign (−1)^m.
///
/// θ is measured from +z and φ from +x to +y. Computed by recurrence in x, y and z, so that the poles are points
/// like any other.
#[derive(Clone, Debug)]
pub struct Basis {
    order: usize,
    // for l ≥ m + 2, at l(l+1)/2 + m: q_l = a (z q_{l−1} − b q_{l−2})
    steps: Vec<[f64; 2]>,
}

impl Basis {
    /// The (`order` + 1)² functions up to `order`.
    pub fn new(order: usize) -> Self {
        let step = |l: usize, m: usize| {
            let (l, m) = (l as f64, m as f64);
            let below = l - 1.0;
            [
                ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt(),
                ((below * below - m * m) / (4.0 * below * below - 1.0)).sqrt(),
            ]
        };
        let steps =
            (0..=order).flat_map(|l| (0..=l).map(move |m| if l >= m + 2 { step(l, m) } else { [0.0; 2] }));
        Self { order, steps: steps.collect() }
    }

    /// Number of functions, (order + 1)².
    pub fn len(&self) -> usize {
        (self.order + 1) * (self.order + 1)
    }

    /// Never true; here because `len` is.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// All functions at a unit direction.
    ///
    /// # Panics
    /// If `out` does not hold [`len`](Self::len) values.
    pub fn evaluate(&self, [x, y, z]: [f64; 3], out: &mut [f64]) {
        assert_eq!(out.len(), self.len(), "values of spherical harmonics up to order {}", self.order);
        // sin^m θ cos mφ and sin^m θ sin mφ, and K P / sin^m θ for l = m
        let (mut cos, mut sin, mut diagonal) = (1.0, 0.0, (0.25 / PI).sqrt());
        for m in 0..=self.order {
            let mut put = |l: usize, q: f64| {
                let centre = l * l + l;
                if m == 0 {
                    out[centre] = q;
                } else {
                    out[centre + m] = SQRT_2 * q * cos;
                    out[centre - m] = SQRT_2 * q * sin;
                }
            };
            put(m, diagonal);
            let (mut before, mut last) = (diagonal, ((2 * m + 3) as f64).sqrt() * z * diagonal);
            for l in m + 1..=self.order {
                if l > m + 1 {
                    let [a, b] = self.steps[l * (l + 1) / 2 + m];
                    (before, last) = (last, a * (z * last - b * before));
                }
                put(l, last);
            }
            (cos, sin) = (cos * x - sin * y, cos * y + sin * x);
            diagonal *= -((2 * m + 3) as f64 / (2 * m + 2) as f64).sqrt();
        }
    }

    /// All functions at every direction, `[directions, len]` row-major.
    pub fn matrix(&self, directions: &[[f64; 3]]) -> Vec<f64> {
        let mut out = vec![0.0; self.len() * directions.len()];
        for (row, d) in out.chunks_exact_mut(self.len()).zip(directions) {
            self.evaluate(*d, row);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::Equirect;

    #[test]
    fn low_orders_are_the_textbook_polynomials() {
        let length = (0.3_f64 * 0.3 + 0.5 * 0.5 + 0.8 * 0.8).sqrt();
        let [x, y, z] = [0.3, -0.5, 0.8].map(|v| v / length);
        let mut out = [0.0; 9];
        Basis::new(2).evaluate([x, y, z], &mut out);
        let (k1, k2) = ((0.75 / PI).sqrt(), (3.75 / PI).sqrt());
        let expected = [
            (0.25 / PI).sqrt(),
            -k1 * y,
            k1 * z,
            -k1 * x,
            k2 * x * y,
            -k2 * y * z,
            0.25 * (5.0 / PI).sqrt() * (3.0 * z * z - 1.0),
            -k2 * x * z,
            0.5 * k2 * (x * x - y * y),
        ];
        for (a, b) in out.iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "{out:?} and {expected:?}");
        }
    }

    #[test]
    fn the_basis_is_orthonormal_and_obeys_the_addition_theorem() {
        // midpoints in θ are good to (2l·π/H)²/24
        let (basis, grid) = (Basis::new(8), Equirect::new(32, 256));
        let directions: Vec<_> = grid.directions().iter().map(|d| d.map(f64::from)).collect();
        let matrix = basis.matrix(&directions);
        let n = basis.len();
        for (i, j) in [(0, 0), (3, 3), (0, 6), (40, 40), (80, 80), (66, 80), (64, 66)] {
            let integral: f64 = (0..grid.len())
                .map(|p| grid.solid_angle(p / 32) * matrix[p * n + i] * matrix[p * n + j])
                .sum();
            let expected = if i == j { 1.0 } else { 0.0 };
            assert!((integral - expected).abs() < 3e-3, "{i}, {j}: {integral}");
        }
        for row in matrix.chunks_exact(n).step_by(97) {
            for l in 0..=8 {
                let sum: f64 = row[l * l..(l + 1) * (l + 1)].iter().map(|v| v * v).sum();
                assert!((sum - (2 * l + 1) as f64 / (4.0 * PI)).abs() < 1e-5, "order {l}: {sum}");
            }
        }
    }
}
