//! Numbers that were fitted to HDR panoramas.
//!
//! They were made by
//! ```text
//! cargo run --release -p veni-research --example expansion -- fit DIR
//! ```

use super::FEATURES;

/// What the expansion predicts brightness by. The default is fitted to the outdoor panoramas of the training set.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// The expand map's exponent p, per feature of a [`super::Region`].
    pub exponent: [f64; FEATURES],
    /// ln of the mean radiance of the region that holds the sun, per feature.
    pub sun: [f64; FEATURES],
    /// ln(red/green) of the sun: at the horizon, and per sine of its elevation.
    pub red: [f64; 2],
    /// ln(blue/green) of the sun, likewise.
    pub blue: [f64; 2],
    /// A disc with less than this part of the energy that the expand map gives its region is left out.
    pub faintest: f64,
}

/// The steepest expand map: an aureole is never steeper.
const STEEPEST: f64 = 4.0;

/// The brightest mean of a clipped region, in units of white.
const BRIGHTEST: f64 = 1e5;

impl Default for Parameters {
    fn default() -> Self {
        Self {
            exponent: [0.4124, 0.0359, 0.3278, -0.2130, 0.3144, 0.1731, 0.1088, -0.2365],
            sun: [0.6803, -0.0872, 1.2012, -0.0443, 0.7584, 1.0511, 1.0688, -0.7532],
            red: [0.2453, -0.3382],
            blue: [-0.5239, 0.6943],
            faintest: 0.1,
        }
    }
}

impl Parameters {
    /// The expand map's exponent for a region.
    pub fn exponent(&self, features: &[f64; FEATURES]) -> f64 {
        dot(&self.exponent, features).clamp(0.0, STEEPEST)
    }

    /// Mean luminance of the region that holds the sun, in units of white.
    pub fn mean_radiance(&self, features: &[f64; FEATURES]) -> f64 {
        dot(&self.sun, features).exp().clamp(1.0, BRIGHTEST)
    }

    /// The sun's colour at an elevation with this sine, of luminance 1.
    pub fn colour(&self, sine: f32) -> [f32; 3] {
        let ratio = |[at, slope]: [f64; 2]| (at + slope * f64::from(sine)).exp() as f32;
        let [r, g, b] = [ratio(self.red), 1.0, ratio(self.blue)];
        let y = veni_image::luminance([r, g, b]);
        [r / y, g / y, b / y]
    }
}

fn dot(weights: &[f64; FEATURES], features: &[f64; FEATURES]) -> f64 {
    weights.iter().zip(features).map(|(w, f)| w * f).sum()
}
