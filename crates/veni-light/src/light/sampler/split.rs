//! A sky as two lights: the sun and the rest.

use std::f64::consts::PI;

use super::alias::BELOW_ONE;
use super::{Sample, Sampler};
use crate::light::{CompactLight, luminance};
use crate::vector::{across, narrow, unit, wide};

/// Draws the sun, as a disc, or the rest of the sky, by their power. Radiance and density are those of both together, so that a
/// sample needs no second look.
#[derive(Clone, Debug)]
pub struct SplitSampler<'a> {
    rest: Sampler<'a>,
    sun: CompactLight,
    /// Two directions across the sun's.
    across: [[f32; 3]; 2],
    radiance: [f32; 3],
    /// 1 − cos of the sun's radius.
    cap: f32,
    /// Probability of the sun.
    share: f32,
}

impl<'a> SplitSampler<'a> {
    /// A sun and a sampler of what is left without it. A sun of no radius cannot be met by chance and has no density: it is given
    /// the true sun's.
    pub fn new(mut sun: CompactLight, rest: Sampler<'a>) -> Self {
        if sun.radius <= 0.0 {
            sun.radius = CompactLight::SUN_RADIUS;
        }
        let power = |rgb: [f64; 3]| f64::from(luminance(rgb.map(|v| v as f32)));
        let (own, others) = (power(sun.irradiance.map(f64::from)), power(rest.map.map().integral()));
        let share = if own + others > 0.0 { (own / (own + others)) as f32 } else { 0.0 };
        let half = (0.5 * f64::from(sun.radius)).sin();
        Self {
            across: across(wide(sun.direction)).map(narrow),
            radiance: sun.radiance(),
            cap: (2.0 * half * half) as f32,
            share,
            sun,
            rest,
        }
    }

    /// The probability of drawing the sun.
    pub fn share(&self) -> f32 {
        self.share
    }

    /// The sun, its radius that of the disc that is drawn.
    pub fn sun(&self) -> &CompactLight {
        &self.sun
    }

    /// Two unit vectors across the sun's direction and each other, by which its disc is drawn: for a shader.
    pub fn across(&self) -> [[f32; 3]; 2] {
        self.across
    }

    /// A direction from two numbers of [0, 1).
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> Sample {
        if u >= self.share {
            let sample = self.rest.sample([((u - self.share) / (1.0 - self.share)).min(BELOW_ONE), v]);
            return self.both(sample.direction, sample.radiance, sample.pdf);
        }
        let drop = self.cap * (u / self.share);
        let tilt = (drop * (2.0 - drop)).sqrt();
        let (s, c) = (2.0 * PI as f32 * v).sin_cos();
        let [a, b] = self.across;
        let direction =
            unit([0, 1, 2].map(|i| self.sun.direction[i] * (1.0 - drop) + tilt * (c * a[i] + s * b[i])));
        let radiance = self.rest.radiance(direction);
        let pdf = self.rest.density(radiance);
        // drawn from the disc, whatever rounding says of its edge
        self.mixed(true, direction, radiance, pdf)
    }

    /// The density with which a unit direction is drawn, 1/sr.
    #[inline]
    pub fn pdf(&self, direction: [f32; 3]) -> f32 {
        self.both(direction, [0.0; 3], self.rest.pdf(direction)).pdf
    }

    /// Adds the sun to what the rest has in a direction.
    #[inline]
    fn both(&self, direction: [f32; 3], radiance: [f32; 3], pdf: f32) -> Sample {
        let square: f32 = direction.iter().zip(self.sun.direction).map(|(a, b)| (a - b) * (a - b)).sum();
        self.mixed(0.5 * square <= self.cap, direction, radiance, pdf)
    }

    #[inline]
    fn mixed(&self, inside: bool, direction: [f32; 3], radiance: [f32; 3], pdf: f32) -> Sample {
        let rest = (1.0 - self.share) * pdf;
        if !inside {
            return Sample { direction, radiance, pdf: rest };
        }
        let radiance = [0, 1, 2].map(|c| radiance[c] + self.radiance[c]);
        Sample { direction, radiance, pdf: rest + self.share / (2.0 * PI as f32 * self.cap) }
    }
}
