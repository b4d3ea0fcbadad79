//! The sun of a sky, conditioned on its vectors. MODEL (74).
//!
//! In the whitened coordinates of [`Prior`], w = L⁻¹c and g = K⁻¹(z − μ), with e, ξ and η (circular complex) standard normal:
//!
//! - azimuth φ: the argument of ⟨a, w⟩ + σe,
//! - measures t = b + B g + S ξ: ln((s + 0.1)/(1.1 − s)) of the sine s of the elevation, logarithms of luminance, red/green and blue/green of the
//!   irradiance at normal incidence before the exposure, and of the angular radius,
//! - there is a sun where ⟨p, g⟩ + p₀ + η > 0, and s > 0.
//!
//! A turn of the code multiplies w by e^{iα} and with it the sun's direction: the density is equivariant, exactly.

mod learn;
#[cfg(feature = "gradients")]
mod request;

#[cfg(feature = "gradients")]
pub use request::SunRequest;

use super::draw::{Draw, MEASURES};
use crate::cholesky::Complex;
use crate::compact::{CompactLight, Kind, RadiusSource};
use crate::luminance::{LUMINANCE as LUMINANCE_OF, luminance};
use crate::random::exp;

/// Place of a measure.
const ELEVATION: usize = 0;
const LUMINANCE: usize = 1;
const COLOUR: [usize; 2] = [2, 3];
const RADIUS: usize = 4;
/// A logistic function of 1.702 x is within 0.01 of the normal distribution's at x.
const LOGIT_TO_PROBIT: f64 = 1.702;
/// How far beyond the horizon and the zenith the elevation's measure reaches, in its sine.
const MARGIN: f64 = 0.1;
/// Widest sun that is drawn, radians: 6°.
const WIDEST: f64 = 6.0 * std::f64::consts::PI / 180.0;

/// Density of a sky's sun given its vectors: azimuth, elevation, luminance, colour and radius are linear in the whitened vectors plus
/// normal noise, and so is the score of whether there is one (docs/MODEL.md (74)). It rotates with them, exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct SunPrior {
    /// a, [N].
    pub(crate) azimuth: Vec<[f32; 2]>,
    /// σ.
    pub(crate) azimuth_noise: f32,
    /// B, row-major [MEASURES, N].
    pub(crate) weights: Vec<f32>,
    /// b.
    pub(crate) mean: [f32; MEASURES],
    /// S, a lower triangle [MEASURES, MEASURES].
    pub(crate) noise: [[f32; MEASURES]; MEASURES],
    /// p and p₀, [N + 1].
    pub(crate) presence: Vec<f32>,
}

impl SunPrior {
    /// N, the number of vectors that it is conditioned on.
    pub fn latent_vectors(&self) -> usize {
        self.azimuth.len()
    }

    /// The sun of a draw, where there is one.
    pub(super) fn sun(&self, draw: &Draw) -> Option<CompactLight> {
        if self.score(draw) <= 0.0 {
            return None;
        }
        let t = self.measures(draw);
        (sine(&t) > 0.0).then(|| self.light(self.heading(draw), t))
    }

    /// How likely it is that there is a sun, and the most likely one, given the numbers of a draw for the vectors.
    pub(super) fn likely(&self, draw: &Draw) -> (f64, CompactLight) {
        // the normal distribution's function by the logistic one, as it was fitted
        let chance = 1.0 / (1.0 + exp(-LOGIT_TO_PROBIT * self.score(draw)));
        (chance, self.light(self.heading(draw), self.measures(draw)))
    }

    fn light(&self, [x, y]: Complex, t: [f64; MEASURES]) -> CompactLight {
        let sine = sine(&t).max(0.0);
        let length = (x * x + y * y).sqrt();
        let cosine = (1.0 - sine * sine).sqrt() / length.max(f64::MIN_POSITIVE);
        let direction = [x * cosine, y * cosine, sine].map(|v| v as f32);
        let irradiance = irradiance(&t).map(|v| v as f32);
        let radius = exp(t[RADIUS]).min(WIDEST) as f32;
        match Kind::of(radius) {
            // what a photograph's pixels blur is a disc of the sun's true size
            Kind::Disc => CompactLight {
                radius_source: RadiusSource::Assumed,
                ..CompactLight::new(direction, irradiance, CompactLight::SUN_RADIUS)
            },
            _ => CompactLight::new(direction, irradiance, radius),
        }
    }

    /// ⟨p, g⟩ + p₀ + η: positive where there is a sun.
    fn score(&self, draw: &Draw) -> f64 {
        let (weights, bias) = self.presence.split_at(self.latent_vectors());
        dot(weights, &draw.g) + f64::from(bias[0]) + draw.sun.presence
    }

    /// ⟨a, w⟩ + σe.
    fn heading(&self, draw: &Draw) -> Complex {
        let noise = draw.sun.azimuth.map(|v| f64::from(self.azimuth_noise) * v);
        self.azimuth.iter().zip(&draw.w).fold(noise, |[x, y], (a, [re, im])| {
            let [a, b] = a.map(f64::from);
            [x + a * re - b * im, y + a * im + b * re]
        })
    }

    /// t = b + B g + S ξ.
    pub(crate) fn measures(&self, draw: &Draw) -> [f64; MEASURES] {
        std::array::from_fn(|k| {
            f64::from(self.mean[k]) + dot(self.row(k), &draw.g) + dot(&self.noise[k], &draw.sun.measures)
        })
    }

    fn row(&self, row: usize) -> &[f32] {
        let n = self.latent_vectors();
        &self.weights[row * n..(row + 1) * n]
    }
}

/// The elevation's measure, ln((s + a)/(1 + a − s)) of its sine s: as a logit it hardly bounds the sine, and with a = 0.1 the horizon
/// and the zenith are no further from the middle of the sky than a sample may be.
pub(crate) fn elevation_measure(sine: f64) -> f64 {
    ((sine + MARGIN) / (1.0 + MARGIN - sine)).ln()
}

/// The inverse, the sine of the elevation, below 0 for a sun that has set. Here as below exact operations and our own exponential alone: a seed is a sky on every machine.
pub(crate) fn sine(t: &[f64; MEASURES]) -> f64 {
    ((1.0 + 2.0 * MARGIN) / (1.0 + exp(-t[ELEVATION])) - MARGIN).min(1.0)
}

/// Irradiance at normal incidence.
pub(crate) fn irradiance(t: &[f64; MEASURES]) -> [f64; 3] {
    let ([r, g, b], [red, blue]) = (LUMINANCE_OF.map(f64::from), COLOUR.map(|c| exp(t[c])));
    let green = exp(t[LUMINANCE]) / (r * red + g + b * blue);
    [green * red, green, green * blue]
}

/// Luminance, and red and blue as multiples of green, of what has all three.
fn colour([r, g, b]: [f32; 3]) -> Option<(f64, [f64; 2])> {
    let luminance = f64::from(luminance([r, g, b]));
    let [r, g, b] = [r, g, b].map(f64::from);
    (r > 0.0 && g > 0.0 && b > 0.0).then_some((luminance, [r / g, b / g]))
}

fn dot(a: &[f32], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * b).sum()
}

#[cfg(all(test, feature = "gradients"))]
mod tests;
