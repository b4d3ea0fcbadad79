//! Positive lobes that add up to radiance, with the error in log radiance: as the reference's baseline, over the whole
//! sphere and by solid angle.

use super::descent::Problem;
use super::{Gaussians, SphericalGaussian, shape};
use crate::baseline::target::Target;

/// J = Σ ω |ln(e^b + Σ_g e^{w_g} e^{λ_g(⟨μ_g,d⟩ − 1)}) − t|² / 3. Free numbers: the shapes, then w per lobe, then b.
pub(super) struct Mixture<'a> {
    lobes: usize,
    target: &'a Target,
}

impl<'a> Mixture<'a> {
    pub(super) fn new(lobes: usize, target: &'a Target) -> Self {
        Self { lobes, target }
    }
}

impl Problem for Mixture<'_> {
    fn lobes(&self) -> usize {
        self.lobes
    }

    fn target(&self) -> &Target {
        self.target
    }

    /// The darkest value is left to the constant; a lobe starts with the average of the target under it, in its
    /// own weights.
    fn start(&self, shapes: &[f64]) -> Vec<f64> {
        let Target { directions, weights, values, .. } = self.target;
        let matrix = shape::matrix(shapes, directions);
        let average = |k: usize| {
            let (mut sum, mut total) = ([0.0; 3], 0.0);
            for ((row, w), t) in matrix.chunks_exact(self.lobes + 1).zip(weights).zip(values) {
                total += w * row[k];
                sum.iter_mut().zip(t).for_each(|(s, t)| *s += w * row[k] * t);
            }
            sum.map(|s| s / total)
        };
        let low = values.iter().fold([f64::INFINITY; 3], |m, t| [0, 1, 2].map(|c| m[c].min(t[c])));
        let mut x = shapes.to_vec();
        (0..self.lobes).for_each(|k| x.extend(average(k)));
        x.extend(low);
        x
    }

    fn loss(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let Target { directions, weights, values, .. } = self.target;
        let (shapes, logs) = x.split_at(shape::FREE * self.lobes);
        let matrix = shape::matrix(shapes, directions);
        let amplitudes: Vec<[f64; 3]> = logs.as_chunks::<3>().0.iter().map(|w| w.map(f64::exp)).collect();
        let (mut loss, mut pull) = (0.0, Vec::with_capacity(self.lobes * directions.len()));
        let mut by_amplitude = vec![[0.0; 3]; self.lobes + 1];
        for ((row, w), t) in matrix.chunks_exact(self.lobes + 1).zip(weights).zip(values) {
            let mut sum = [0.0; 3];
            for (e, a) in row.iter().zip(&amplitudes) {
                sum.iter_mut().zip(a).for_each(|(s, a)| *s += e * a);
            }
            let mut by_sum = [0.0; 3];
            for c in 0..3 {
                let residual = sum[c].ln() - t[c];
                loss += w * residual * residual / 3.0;
                by_sum[c] = 2.0 / 3.0 * w * residual / sum[c];
            }
            // what each lobe's logarithm pulls, per channel: its own amplitude and, added up, its shape
            let each = row.iter().zip(&amplitudes).map(|(e, a)| [0, 1, 2].map(|c| by_sum[c] * e * a[c]));
            for (k, (total, each)) in by_amplitude.iter_mut().zip(each).enumerate() {
                total.iter_mut().zip(each).for_each(|(t, v)| *t += v);
                if k < self.lobes {
                    pull.push(each.iter().sum());
                }
            }
        }
        let mut gradient = shape::gradient(shapes, directions, &pull);
        gradient.extend(by_amplitude.into_iter().flatten());
        (loss, gradient)
    }

    fn gaussians(&self, x: &[f64]) -> Gaussians {
        let (shapes, logs) = x.split_at(shape::FREE * self.lobes);
        let amplitudes: Vec<[f64; 3]> = logs.as_chunks::<3>().0.iter().map(|w| w.map(f64::exp)).collect();
        let lobes = shape::lobes(shapes).zip(&amplitudes);
        Gaussians {
            lobes: lobes
                .map(|((axis, sharpness), a)| SphericalGaussian { axis, sharpness, amplitude: *a })
                .collect(),
            constant: amplitudes[self.lobes],
        }
    }
}
