//! Rotations: about z by phases, by any rotation through a quadrature that is exact for the bands there are.
//! LIGHT (12), (13).

use std::f64::consts::PI;

use super::{Basis, Sh};
use crate::light::quadrature::gauss_legendre;
use crate::vector::dot;

impl<const L: usize> Sh<L> {
    /// The same light rotated by `angle` radians about z, counter-clockwise seen from above: the pair (c_lm, c_l−m)
    /// turns by mα.
    #[must_use]
    pub fn rotated_about_z(&self, angle: f64) -> Self {
        let mut out = self.clone();
        for l in 0..=L {
            for m in 1..=l {
                let (sin, cos) = (m as f64 * angle).sin_cos();
                let (at_cos, at_sin) = (l * l + l + m, l * l + l - m);
                let (a, b) = (self.coefficients[at_cos], self.coefficients[at_sin]);
                for c in 0..3 {
                    out.coefficients[at_cos][c] = a[c] * cos - b[c] * sin;
                    out.coefficients[at_sin][c] = a[c] * sin + b[c] * cos;
                }
            }
        }
        out
    }

    /// The same light under a rotation or reflection R, rows first: what came from d comes from R d.
    ///
    /// # Panics
    /// If the rows of the matrix are not orthonormal to 1e-5.
    #[must_use]
    pub fn rotated(&self, rotation: [[f32; 3]; 3]) -> Self {
        for (i, a) in rotation.iter().enumerate() {
            for (j, b) in rotation.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((dot(*a, *b) - expected).abs() <= 1e-5, "the matrix {rotation:?} is not orthogonal");
            }
        }
        // back to where the light came from: the transposed matrix
        self.mapped(|d| [0, 1, 2].map(|c| rotation.iter().zip(d).map(|(row, v)| f64::from(row[c]) * v).sum()))
    }

    /// Coefficients of d ↦ L(back(d)), where `back` is linear and keeps lengths.
    pub(super) fn mapped(&self, back: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        let basis = Basis::new(L);
        let (mut here, mut there) = (vec![0.0; Self::LEN], vec![0.0; Self::LEN]);
        let mut out = Self::zero();
        let azimuths = 2 * L + 1;
        for (z, weight) in gauss_legendre(L + 1) {
            let r = (1.0 - z * z).sqrt();
            for k in 0..azimuths {
                let (sin, cos) = (2.0 * PI * k as f64 / azimuths as f64).sin_cos();
                let d = [r * cos, r * sin, z];
                basis.evaluate(d, &mut here);
                basis.evaluate(back(d), &mut there);
                let value = self.combine(&there).map(|v| v * weight * 2.0 * PI / azimuths as f64);
                for (c, y) in out.coefficients.iter_mut().zip(&here) {
                    for k in 0..3 {
                        c[k] += y * value[k];
                    }
                }
            }
        }
        out
    }
}
