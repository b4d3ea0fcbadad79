//! The random numbers behind a code. MODEL (35), (74).

use crate::cholesky::Complex;
use crate::random::Stream;

/// Number of measures of a sun ([`SunPrior`](super::SunPrior)).
pub(crate) const MEASURES: usize = 5;

/// Standard normal numbers; w and the sun's heading are circular complex, E|w|² = 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Draw {
    pub(super) w: Vec<Complex>,
    /// N of them, and one more where N is odd.
    pub(super) g: Vec<f64>,
    pub(super) exposure: f64,
    pub(super) sun: SunDraw,
}

/// The random numbers behind a sun.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SunDraw {
    /// η.
    pub(super) presence: f64,
    /// e, E|e|² = 1.
    pub(super) azimuth: Complex,
    /// ξ.
    pub(super) measures: [f64; MEASURES],
}

impl SunDraw {
    pub(super) fn new(rng: &mut Stream) -> Self {
        let [presence, _] = rng.normals();
        let azimuth = rng.normals().map(|v| v * std::f64::consts::FRAC_1_SQRT_2);
        let ([a, b], [c, d], [e, _]) = (rng.normals(), rng.normals(), rng.normals());
        Self { presence, azimuth, measures: [a, b, c, d, e] }
    }
}
