//! The least step of the numbers behind a code that fulfils conditions. MODEL (75).
//!
//! All that is asked for is linear in standard normal numbers, or nearly: a condition moves a draw by the least step that fulfils
//! it (Matheron's rule), x' = x + Rᵀ(R Rᵀ)⁻¹(y − R x) for the rows R that are asked to be y. The moved draw is distributed as the
//! prior given the condition, and what the condition says nothing about stays.

use super::draw::{Draw, MEASURES, SunDraw};
use crate::cholesky::{self, Complex};

impl SunDraw {
    /// Number of its real numbers: presence, then measures.
    pub(crate) const REAL: usize = 1 + MEASURES;

    pub(super) fn real_mut(&mut self) -> [&mut f64; Self::REAL] {
        let [a, b, c, d, e] = &mut self.measures;
        [&mut self.presence, a, b, c, d, e]
    }
}

/// The derivative of something with respect to the numbers of a [`Draw`], and by how much it is to change.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    /// Σ Re(w̄ dw); empty for zeros.
    pub(crate) w: Vec<Complex>,
    /// Empty for zeros.
    pub(crate) g: Vec<f64>,
    pub(crate) sun: [f64; SunDraw::REAL],
    pub(crate) by: f64,
}

impl Row {
    /// A row of zeros.
    pub(crate) fn zero() -> Self {
        Self { w: Vec::new(), g: Vec::new(), sun: [0.0; SunDraw::REAL], by: 0.0 }
    }

    /// R Σ Rᵀ with Σ the covariance of the numbers: the parts of a circular w have a variance of a half.
    fn covariance(&self, other: &Self) -> f64 {
        let w: f64 = self.w.iter().zip(&other.w).map(|([a, b], [c, d])| a * c + b * d).sum();
        let real = self.g.iter().zip(&other.g).chain(self.sun.iter().zip(&other.sun));
        0.5 * w + real.map(|(a, b)| a * b).sum::<f64>()
    }
}

impl Draw {
    /// The least step, in standard deviations, that changes what each row is the derivative of by as much as it says. Rows that
    /// contradict each other change nothing.
    pub(crate) fn shift(&mut self, rows: &[Row]) {
        let k = rows.len();
        let mut gram: Vec<f64> = (0..k * k).map(|at| rows[at / k].covariance(&rows[at % k])).collect();
        let mut by: Vec<[f64; 1]> = rows.iter().map(|row| [row.by]).collect();
        if cholesky::factor(&mut gram, k).is_none() {
            return;
        }
        cholesky::substitute(&gram, k, &mut by);
        for (row, [by]) in rows.iter().zip(by) {
            for (number, weight) in self.w.as_flattened_mut().iter_mut().zip(row.w.as_flattened()) {
                *number += 0.5 * by * weight;
            }
            let sun = self.sun.real_mut().into_iter().zip(&row.sun);
            for (number, weight) in self.g.iter_mut().zip(&row.g).chain(sun) {
                *number += by * weight;
            }
        }
    }
}
