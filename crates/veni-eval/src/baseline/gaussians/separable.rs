//! Amplitudes and constant enter an expansion linearly: for given axes and sharpnesses the best ones are known. Only the
//! shapes are searched (variable projection; Golub & Pereyra 1973). MODEL (48).

use super::descent::Problem;
use super::{Gaussians, SphericalGaussian, shape};
use crate::baseline::least_squares;
use crate::baseline::target::Target;
use veni_light::vector::dot;

/// Added to the Gram matrix (whose lobes have diagonal elements of about 1/4λ): two equal lobes share their amplitude
/// instead of having none.
const RIDGE: f64 = 1e-8;

/// J(shapes) = min over a, b of Σ ω |f − t|² / 3 + ridge (|a|² + |b|²) / 3.
pub(super) struct Separable<'a> {
    lobes: usize,
    target: &'a Target,
}

impl<'a> Separable<'a> {
    pub(super) fn new(lobes: usize, target: &'a Target) -> Self {
        Self { lobes, target }
    }

    fn amplitudes(&self, matrix: &[f64]) -> Vec<[f64; 3]> {
        let Target { weights, values, .. } = self.target;
        least_squares::solve(matrix, self.lobes + 1, weights, values, RIDGE)
            .expect("a Gram matrix with a ridge is positive definite")
    }
}

impl Problem for Separable<'_> {
    fn lobes(&self) -> usize {
        self.lobes
    }

    fn target(&self) -> &Target {
        self.target
    }

    fn start(&self, shapes: &[f64]) -> Vec<f64> {
        shapes.to_vec()
    }

    /// At the best amplitudes J does not change with them, so its gradient is the partial one in the shapes.
    fn loss(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let Target { directions, weights, values, .. } = self.target;
        let matrix = shape::matrix(x, directions);
        let best = self.amplitudes(&matrix);
        let (mut loss, mut pull) = (0.0, Vec::with_capacity(self.lobes * directions.len()));
        for ((row, w), t) in matrix.chunks_exact(self.lobes + 1).zip(weights).zip(values) {
            let mut residual = t.map(|t| -t);
            for (e, a) in row.iter().zip(&best) {
                residual.iter_mut().zip(a).for_each(|(r, a)| *r += e * a);
            }
            loss += w * residual.iter().map(|r| r * r).sum::<f64>() / 3.0;
            let by_sum = residual.map(|r| 2.0 / 3.0 * w * r);
            pull.extend(row.iter().zip(&best[..self.lobes]).map(|(e, a)| e * dot(by_sum, *a)));
        }
        loss += RIDGE / 3.0 * best.iter().flatten().map(|a| a * a).sum::<f64>();
        (loss, shape::gradient(x, directions, &pull))
    }

    fn gaussians(&self, x: &[f64]) -> Gaussians {
        let best = self.amplitudes(&shape::matrix(x, &self.target.directions));
        let lobes = shape::lobes(x).zip(&best);
        Gaussians {
            lobes: lobes
                .map(|((axis, sharpness), a)| SphericalGaussian { axis, sharpness, amplitude: *a })
                .collect(),
            constant: best[self.lobes],
        }
    }
}
