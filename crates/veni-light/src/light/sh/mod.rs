//! Real spherical harmonics of light: projected with exact pixel areas, rotated exactly, made into irradiance, written
//! as engines read them. LIGHT (10) to (15).

mod bands;
mod basis;
mod convention;
mod pixels;
#[cfg(feature = "gradients")]
mod pull_back;
mod rotation;
mod window;

use std::f64::consts::PI;

use super::environment::EnvironmentMap;
use crate::compact::CompactLight;
use crate::field::Field;
use crate::sphere::Equirect;
use crate::vector::{unit, wide};
use crate::{Error, Result};

pub use bands::light_bands;
pub use basis::Basis;
pub use pixels::pixel_integrals;
#[cfg(feature = "gradients")]
pub use pull_back::pull_back_irradiance;
pub use window::Windowed;

/// Coefficients c_lm of L(d) = Σ c_lm Y_lm(d), R, G and B, for l = 0 … `L` and m = −l … l at index l² + l + m, in the native
/// frame; [`Basis`] has the functions. `Sh<2>` are the nine of most engines.
#[derive(Clone, Debug, PartialEq)]
pub struct Sh<const L: usize> {
    coefficients: Vec<[f64; 3]>,
}

impl<const L: usize> Sh<L> {
    /// Number of coefficients, (L + 1)².
    pub const LEN: usize = (L + 1) * (L + 1);

    /// Darkness.
    pub fn zero() -> Self {
        Self { coefficients: vec![[0.0; 3]; Self::LEN] }
    }

    /// From coefficients in the order above.
    ///
    /// # Errors
    /// [`Error`] of kind `Invalid` if there are not (L+1)² or one is not finite.
    pub fn new(coefficients: Vec<[f64; 3]>) -> Result<Self> {
        if coefficients.len() != Self::LEN {
            return Err(Error::invalid(format!(
                "spherical harmonics of order {L} have {} coefficients, got {}",
                Self::LEN,
                coefficients.len()
            )));
        }
        if let Some(at) = coefficients.iter().position(|c| !c.iter().all(|v| v.is_finite())) {
            return Err(Error::invalid(format!(
                "coefficient {at} of the spherical harmonics is {:?}; all must be finite",
                coefficients[at]
            )));
        }
        Ok(Self { coefficients })
    }

    /// The projection of a map, each pixel an area of constant radiance: c_lm = Σ L ∫ Y_lm dω over the pixel.
    pub fn of(map: EnvironmentMap<'_>) -> Self {
        pixels::Integrals::new(map.grid(), L).project(map.pixels())
    }

    /// The coefficients of a field, decoded at the pixels of `grid`.
    pub fn of_field(field: &Field, grid: Equirect) -> Self {
        pixels::Integrals::new(grid, L).project(&field.bake(grid))
    }

    /// A disc of constant radiance, in closed form; of a radius of 0 a point. With E = E⊥, c = cos r:
    /// c_lm = E (P_{l−1}(c) − P_{l+1}(c)) / ((2l + 1)(1 − c)) Y_lm(s).
    pub fn of_light(light: &CompactLight) -> Self {
        let direction = unit(wide(light.direction));
        let mut row = vec![0.0; Self::LEN];
        Basis::new(L).evaluate(direction, &mut row);
        let zonal = bands::of_disc(L, f64::from(light.radius));
        let term =
            |(index, y): (usize, f64)| light.irradiance.map(|e| f64::from(e) * zonal[index.isqrt()] * y);
        Self { coefficients: row.into_iter().enumerate().map(term).collect() }
    }

    /// The coefficients in the order above.
    pub fn coefficients(&self) -> &[[f64; 3]] {
        &self.coefficients
    }

    /// The sum of two lights.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let sum = |(a, b): (&[f64; 3], &[f64; 3])| [0, 1, 2].map(|c| a[c] + b[c]);
        Self { coefficients: self.coefficients.iter().zip(&other.coefficients).map(sum).collect() }
    }

    /// Every band times a factor.
    #[must_use]
    pub fn banded(&self, factor: impl Fn(usize) -> f64) -> Self {
        let scaled = |(index, c): (usize, &[f64; 3])| c.map(|v| v * factor(index.isqrt()));
        Self { coefficients: self.coefficients.iter().enumerate().map(scaled).collect() }
    }

    /// What these coefficients say in a direction, given as any vector but 0.
    pub fn value(&self, direction: [f32; 3]) -> [f64; 3] {
        let mut row = vec![0.0; Self::LEN];
        Basis::new(L).evaluate(unit(wide(direction)), &mut row);
        self.combine(&row)
    }

    /// Irradiance as a function of the normal: every band of radiance times A_l of [`cosine_lobe`].
    #[must_use]
    pub fn irradiance(&self) -> Self {
        self.banded(cosine_lobe)
    }

    fn combine(&self, row: &[f64]) -> [f64; 3] {
        row.iter().zip(&self.coefficients).fold([0.0; 3], |sum, (y, c)| [0, 1, 2].map(|k| sum[k] + y * c[k]))
    }
}

/// A_l, the band factors of the clamped cosine: π, 2π/3, π/4, 0, −π/24 …
///
/// A_l = 2π (−1)^{l/2−1} / ((l + 2)(l − 1)) · l! / (2^l ((l/2)!)²) for even l, 0 for odd l > 1.
pub fn cosine_lobe(l: usize) -> f64 {
    if l == 1 {
        return 2.0 * PI / 3.0;
    }
    if l % 2 == 1 {
        return 0.0;
    }
    // l! / (2^l ((l/2)!)²) = Π (2k − 1) / 2k
    let ratio: f64 = (1..=l / 2).map(|k| (2 * k - 1) as f64 / (2 * k) as f64).product();
    let sign = if (l / 2) % 2 == 1 { 1.0 } else { -1.0 };
    2.0 * PI * sign * ratio / ((l as f64 + 2.0) * (l as f64 - 1.0))
}

#[cfg(test)]
mod tests;
