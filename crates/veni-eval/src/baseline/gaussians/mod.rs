//! Spherical Gaussians: 6 numbers per lobe and a constant of 3.

mod descent;
mod greedy;
mod mixture;
pub mod reference;
mod separable;
mod shape;

pub use descent::Search;

use super::target::Target;
use crate::Result;
use veni_light::vector::dot;

/// One lobe, a e^{λ(⟨μ,d⟩ − 1)}. It counts as six numbers: two for the axis, one for the sharpness, three for the colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphericalGaussian {
    /// μ, unit length.
    pub axis: [f64; 3],
    /// λ > 0; the half width at 1/e of the peak is about √(2/λ) radians.
    pub sharpness: f64,
    /// a, per channel. In an expansion of log radiance it may be negative.
    pub amplitude: [f64; 3],
}

/// f_c(d) = b_c + Σ_g a_gc e^{λ_g(⟨μ_g,d⟩ − 1)}. Native frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussians {
    /// The lobes, anywhere on the sphere.
    pub lobes: Vec<SphericalGaussian>,
    /// b, per channel: what is left where no lobe reaches.
    pub constant: [f64; 3],
}

impl Gaussians {
    /// f at every (unit) direction.
    pub fn values(&self, directions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let value = |d: &[f64; 3]| {
            self.lobes.iter().fold(self.constant, |sum, lobe| {
                let e = (lobe.sharpness * (dot(lobe.axis, *d) - 1.0)).exp();
                [0, 1, 2].map(|c| sum[c] + lobe.amplitude[c] * e)
            })
        };
        directions.iter().map(value).collect()
    }

    /// ∫ f dω / 4π; a lobe's is a (1 − e^{−2λ})/2λ.
    pub fn mean(&self) -> [f64; 3] {
        self.lobes.iter().fold(self.constant, |sum, lobe| {
            let share = -(-2.0 * lobe.sharpness).exp_m1() / (2.0 * lobe.sharpness);
            [0, 1, 2].map(|c| sum[c] + lobe.amplitude[c] * share)
        })
    }

    /// Lobes of either sign that expand the target itself, whichever its space.
    pub(super) fn fit(lobes: usize, target: &Target, search: &Search) -> Result<Self> {
        search.run(&separable::Separable::new(lobes, target))
    }

    /// Positive lobes that add up to radiance, fitted in log radiance. The target must be log radiance.
    pub(super) fn fit_mixture(lobes: usize, target: &Target, search: &Search) -> Result<Self> {
        search.run(&mixture::Mixture::new(lobes, target))
    }
}

#[cfg(test)]
mod tests;
