//! Suns on request. MODEL (75).

use super::{ELEVATION, LUMINANCE, SunPrior, elevation_measure};
use crate::cholesky::Complex;
use crate::latent::draw::{Draw, MEASURES, SunDraw};
use crate::latent::step::Row;

/// What is asked of the sun of a random sky; what is None is left to chance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SunRequest {
    /// Whether there is one. A direction implies one.
    pub present: Option<bool>,
    /// Azimuth, radians, counter-clockwise from +x seen from above.
    pub azimuth: Option<f64>,
    /// Elevation, radians, in (0, π/2).
    pub elevation: Option<f64>,
}

/// Smallest sine of an elevation, and what is left to 1 at least: requests of 0° and 90° are these.
const EDGE: f64 = 1e-4;

impl SunRequest {
    /// Whether there is to be one, if that is asked.
    pub fn presence(&self) -> Option<bool> {
        if self.azimuth.is_some() || self.elevation.is_some() { Some(true) } else { self.present }
    }
}

impl SunPrior {
    /// What moves a draw so that presence and elevation of its sun are as asked: both are linear.
    pub(crate) fn rows(&self, request: &SunRequest, draw: &Draw) -> Vec<Row> {
        let score = self.score(draw);
        let presence = request.presence().map(|present| {
            // as far on the other side; or where it is, so that nothing else that is asked moves it
            let by = if present == (score > 0.0) { 0.0 } else { -2.0 * score };
            Row { by, ..self.presence_row() }
        });
        let elevation = request.elevation.map(|elevation| {
            let sine = elevation.sin().clamp(EDGE, 1.0 - EDGE);
            self.measure_to(elevation_measure(sine), ELEVATION, draw)
        });
        presence.into_iter().chain(elevation).collect()
    }

    /// What moves the luminance of a draw's sun to a logarithm.
    pub(crate) fn luminance_to(&self, log_luminance: f64, draw: &Draw) -> Row {
        self.measure_to(log_luminance, LUMINANCE, draw)
    }

    fn measure_to(&self, value: f64, measure: usize, draw: &Draw) -> Row {
        let mut derivative = [0.0; MEASURES];
        derivative[measure] = 1.0;
        Row { by: value - self.measures(draw)[measure], ..self.measure_row(derivative) }
    }

    /// The derivative of Σ d t, for d the derivatives with respect to the measures t.
    pub(crate) fn measure_row(&self, derivatives: [f64; MEASURES]) -> Row {
        let mut row = Row { g: vec![0.0; self.latent_vectors()], ..Row::zero() };
        for (k, derivative) in derivatives.into_iter().enumerate() {
            let own = &mut row.sun[SunDraw::REAL - MEASURES..];
            let parts = [(row.g.as_mut_slice(), self.row(k)), (own, self.noise[k].as_slice())];
            for (sum, weight) in parts.into_iter().flat_map(|(sums, weights)| sums.iter_mut().zip(weights)) {
                *sum += derivative * f64::from(*weight);
            }
        }
        row
    }

    fn presence_row(&self) -> Row {
        let n = self.latent_vectors();
        let mut row = Row { g: self.presence[..n].iter().map(|v| f64::from(*v)).collect(), ..Row::zero() };
        row.sun[0] = 1.0;
        row
    }

    /// Turns ⟨a, w⟩ + σe to an azimuth by the least step, its length kept.
    pub(crate) fn head(&self, azimuth: f64, draw: &mut Draw) {
        let [x, y] = self.heading(draw);
        let (length, (sin, cos)) = (x.hypot(y), azimuth.sin_cos());
        let step: Complex = [length * cos - x, length * sin - y];
        let noise = f64::from(self.azimuth_noise);
        let norm =
            noise * noise + self.azimuth.as_flattened().iter().map(|a| f64::from(*a).powi(2)).sum::<f64>();
        let step = step.map(|v| v / norm);
        for (w, a) in draw.w.iter_mut().zip(&self.azimuth) {
            // times the conjugate of a
            let [a, b] = a.map(f64::from);
            *w = [w[0] + a * step[0] + b * step[1], w[1] + a * step[1] - b * step[0]];
        }
        let own = &mut draw.sun.azimuth;
        *own = [own[0] + noise * step[0], own[1] + noise * step[1]];
    }
}
