//! What a fit gives.

use super::gaussians::{Gaussians, SphericalGaussian};
use super::harmonics::Harmonics;
use super::{Baseline, TargetSpace};
use crate::{Error, Result};

/// Where an expansion of radiance itself falls below this share of its own mean over the sphere, it is held there: such
/// expansions ring below zero, which has no logarithm. A thousandth of the mean is black on any display.
pub const FLOOR: f64 = 1e-3;

/// The expansion itself.
#[derive(Clone, Debug, PartialEq)]
pub enum BaselineField {
    /// Spherical harmonics.
    Harmonics(Harmonics),
    /// Spherical Gaussians.
    Gaussians(Gaussians),
}

/// A baseline fitted to one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// What the field is an expansion of.
    pub space: TargetSpace,
    /// The field.
    pub field: BaselineField,
}

impl Fitted {
    /// Natural-log radiance at (unit) directions of the native frame. An expansion of radiance is held above
    /// [`FLOOR`] times its mean.
    pub fn log_radiance(&self, directions: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let directions: Vec<_> = directions.iter().map(|d| d.map(f64::from)).collect();
        let (values, mean) = match &self.field {
            BaselineField::Harmonics(field) => (field.values(&directions), field.mean()),
            BaselineField::Gaussians(field) => (field.values(&directions), field.mean()),
        };
        let floor = mean.map(|m| (FLOOR * m).max(f64::from(f32::MIN_POSITIVE)));
        let log = |v: [f64; 3]| match self.space {
            TargetSpace::Log => v.map(|v| v as f32),
            TargetSpace::Linear => [0, 1, 2].map(|c| v[c].max(floor[c]).ln() as f32),
        };
        values.into_iter().map(log).collect()
    }

    /// The fit of `system` that [`Fitted::parameters`] of it describes.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not [`Baseline::dimension`] coefficients or one of them is not finite.
    pub fn from_parameters(system: &Baseline, parameters: &[f64]) -> Result<Self> {
        let (expected, given) = (system.dimension(), parameters.len());
        if given != expected || parameters.iter().any(|v| !v.is_finite()) {
            return Err(Error::invalid(format!(
                "a baseline of {expected} coefficients cannot be made from these {given}: each must be finite"
            )));
        }
        let (triples, _) = parameters.as_chunks::<3>();
        let field = match system {
            Baseline::SphericalHarmonics { .. } => {
                BaselineField::Harmonics(Harmonics::new(triples.to_vec())?)
            }
            Baseline::SphericalGaussians { .. } | Baseline::GaussianMixture { .. } => {
                let (constant, lobes) = triples.split_last().expect("a constant at least: checked above");
                let lobe = |[place, amplitude]: &[[f64; 3]; 2]| {
                    let [theta, phi, log_sharpness] = *place;
                    let ((st, ct), (sp, cp)) = (theta.sin_cos(), phi.sin_cos());
                    SphericalGaussian {
                        axis: [st * cp, st * sp, ct],
                        sharpness: log_sharpness.exp(),
                        amplitude: *amplitude,
                    }
                };
                let lobes = lobes.as_chunks::<2>().0.iter().map(lobe).collect();
                BaselineField::Gaussians(Gaussians { lobes, constant: *constant })
            }
        };
        Ok(Self { space: system.space(), field })
    }

    /// Every number that the field consists of, [`Baseline::dimension`] of them. Harmonics:
    /// per function red, green, blue. Gaussians: per lobe θ and φ of the axis, ln λ, and the amplitude's red, green,
    /// blue; then the constant's.
    pub fn parameters(&self) -> Vec<f64> {
        match &self.field {
            BaselineField::Harmonics(field) => field.coefficients().as_flattened().to_vec(),
            BaselineField::Gaussians(field) => {
                let lobe = |l: &super::gaussians::SphericalGaussian| {
                    let ([x, y, z], [r, g, b]) = (l.axis, l.amplitude);
                    [x.hypot(y).atan2(z), y.atan2(x), l.sharpness.ln(), r, g, b]
                };
                field.lobes.iter().flat_map(lobe).chain(field.constant).collect()
            }
        }
    }
}
