//! Spherical harmonics: 3(L+1)² numbers.

pub mod reference;

pub use veni_light::light::sh::Basis;

use super::least_squares;
use super::target::Target;
use crate::{Error, Result};

/// f_c(d) = Σ_lm x_lm,c Y_lm(d), per channel; see [`Basis`]. Native frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    order: usize,
    coefficients: Vec<[f64; 3]>,
}

impl Harmonics {
    /// From coefficients in the order of [`Basis`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if their number is not (L+1)² for an L.
    pub fn new(coefficients: Vec<[f64; 3]>) -> Result<Self> {
        let side = coefficients.len().isqrt();
        if side == 0 || side * side != coefficients.len() {
            return Err(Error::invalid(format!(
                "{} spherical-harmonics coefficients per channel; give (L+1)²: 1, 4, 9, 16 …",
                coefficients.len()
            )));
        }
        Ok(Self { order: side - 1, coefficients })
    }

    /// L.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Per function and channel, in the order of [`Basis`].
    pub fn coefficients(&self) -> &[[f64; 3]] {
        &self.coefficients
    }

    /// f at every (unit) direction.
    pub fn values(&self, directions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let basis = Basis::new(self.order);
        let mut row = vec![0.0; basis.len()];
        let value = |d: &[f64; 3]| {
            basis.evaluate(*d, &mut row);
            combine(&row, &self.coefficients)
        };
        directions.iter().map(value).collect()
    }

    /// ∫ f dω / 4π.
    pub fn mean(&self) -> [f64; 3] {
        self.coefficients[0].map(|c| c * (0.25 / std::f64::consts::PI).sqrt())
    }

    /// The minimum of Σ ω |f − t|² over the whole sphere, ω the pixels' solid angles.
    pub(super) fn fit(order: usize, target: &Target) -> Result<Self> {
        let basis = Basis::new(order);
        let matrix = basis.matrix(&target.directions);
        least_squares::solve(&matrix, basis.len(), &target.weights, &target.values, 0.0)
            .map(|coefficients| Self { order, coefficients })
            .ok_or_else(|| {
                Error::invalid(format!(
                    "spherical harmonics of order {order}: {} pixels do not determine {} coefficients; \
                     use a larger image or a lower order",
                    target.weights.len(),
                    basis.len()
                ))
            })
    }
}

/// Σ_k f_k x_k.
fn combine(row: &[f64], coefficients: &[[f64; 3]]) -> [f64; 3] {
    row.iter().zip(coefficients).fold([0.0; 3], |sum, (f, x)| [0, 1, 2].map(|c| sum[c] + f * x[c]))
}
