//! Losses that look at each pixel alone, with their derivatives, in f64. MODEL (43–47).

use super::config::Objective;
use super::target::{FitTarget, TargetImage};
use veni_image::{luminance, tonemap};

/// Where the absolute error turns from a parabola into a line, in log radiance.
const ROUNDING: f64 = 0.1;

/// Where the part of [`Objective::Energy`] that goes by light turns from a parabola into a line, in log radiance.
const REACH: f64 = 1.0;

/// A pixel's part of a loss around a prediction, channel by channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PixelValue {
    pub(super) loss: f64,
    pub(super) gradient: [f64; 3],
    /// The Gauss–Newton weight: the second derivative of the parabola that stands for the loss. At least 0.
    pub(super) gauss_newton: [f64; 3],
}

/// One image's loss: a sum over pixels.
#[derive(Debug)]
pub(super) struct PixelLoss<'a> {
    objective: Objective,
    image: &'a [f32],
    clipped: Option<&'a [bool]>,
    /// Per pixel; 0 where nothing is known.
    weights: Vec<f64>,
    /// Per pixel, what the light that comes from there adds to its weight; if that counts.
    light: Vec<f64>,
    /// Log of the white point.
    white: f64,
    /// The image as shown, if that is compared.
    shown: Vec<f64>,
}

impl<'a> PixelLoss<'a> {
    /// Of each image, under an objective that [looks at each pixel alone](Objective::is_pixelwise).
    pub(super) fn of_images(objective: Objective, target: &FitTarget<'a>) -> Vec<Self> {
        let areas = target.areas();
        target.images().iter().map(|image| Self::new(objective, *image, &areas)).collect()
    }

    pub(super) fn new(objective: Objective, image: TargetImage<'a>, areas: &[f64]) -> Self {
        let TargetImage { log_radiance: image, mask, clipped } = image;
        let pixels = areas.len() as f64;
        let counts = |p: usize| mask.map_or(1.0, |m| f64::from(m[p]));
        let weights: Vec<f64> = match objective {
            Objective::ReferenceLogError => (0..areas.len()).map(|p| counts(p).powi(2) / pixels).collect(),
            _ => {
                let total: f64 = areas.iter().enumerate().map(|(p, area)| area * counts(p)).sum();
                areas.iter().enumerate().map(|(p, area)| area * counts(p) / total).collect()
            }
        };
        let (weights, light) = match objective {
            Objective::Energy { weight } => by_light(image, weights, weight),
            _ => (weights, Vec::new()),
        };
        let (white, shown) = match objective {
            Objective::Display { .. } => {
                let white = white(image, &weights);
                (white, image.iter().map(|i| tonemap::srgb_of_log(f64::from(*i) - white).0).collect())
            }
            _ => (0.0, Vec::new()),
        };
        Self { objective, image, clipped, weights, light, white, shown }
    }

    /// The pixel's part of the loss for log radiance `prediction`.
    pub(super) fn at(&self, pixel: usize, prediction: [f64; 3]) -> PixelValue {
        let area = self.weights[pixel];
        let weight = area + self.light.get(pixel).copied().unwrap_or(0.0);
        let mut out = PixelValue::default();
        if weight == 0.0 {
            return out;
        }
        for (c, p) in prediction.into_iter().enumerate() {
            let k = 3 * pixel + c;
            let i = f64::from(self.image[k]);
            let error = p - i;
            if error > 0.0 && self.clipped.is_some_and(|clipped| clipped[k]) {
                continue;
            }
            let (value, gradient, gauss_newton) = match self.objective {
                Objective::LogAbsolute => {
                    // the parabola through the same value and gradient that lies above it everywhere
                    let root = error.hypot(ROUNDING);
                    (root - ROUNDING, error / root, 1.0 / root)
                }
                Objective::Display { log } => {
                    let (shown, by) = tonemap::srgb_of_log(p - self.white);
                    let difference = shown - self.shown[k];
                    let gradient = 2.0 * difference * by + 2.0 * log * error;
                    (difference * difference + log * error * error, gradient, 2.0 * by * by + 2.0 * log)
                }
                Objective::Energy { .. } => {
                    // e² where it is small, a line where it is not: see `Objective::Energy`
                    let (root, light) = ((error / REACH).hypot(1.0), self.light[pixel]);
                    let value = area * error * error + light * 2.0 * REACH * REACH * (root - 1.0);
                    let by = area + light / root;
                    (value / weight, 2.0 * error * by / weight, 2.0 * by / weight)
                }
                _ => (error * error, 2.0 * error, 2.0),
            };
            // the mean over the channels
            out.loss += weight / 3.0 * value;
            out.gradient[c] = weight / 3.0 * gradient;
            out.gauss_newton[c] = weight / 3.0 * gauss_newton;
        }
        out
    }
}

/// What is left of the weights, and `energy_weight` of their sum dealt out by the light that comes from each pixel.
fn by_light(image: &[f32], weights: Vec<f64>, energy_weight: f64) -> (Vec<f64>, Vec<f64>) {
    let luminance = |rgb: &[f32]| f64::from(luminance([0, 1, 2].map(|c| rgb[c].exp())));
    // what is unknown may be anything
    let light =
        image.chunks_exact(3).zip(&weights).map(|(rgb, w)| if *w > 0.0 { w * luminance(rgb) } else { 0.0 });
    let light: Vec<f64> = light.collect();
    let (sum, total) = (weights.iter().sum::<f64>(), light.iter().sum::<f64>());
    let scale = if total > 0.0 { energy_weight * sum / total } else { 0.0 };
    let rest = weights.into_iter().map(|w| (1.0 - energy_weight) * w).collect();
    (rest, light.into_iter().map(|light| scale * light).collect())
}

/// The log of the 98 % quantile of an image's known values.
fn white(image: &[f32], weights: &[f64]) -> f64 {
    let known = image.chunks_exact(3).zip(weights).filter(|(_, w)| **w > 0.0);
    let radiance: Vec<f32> = known.flat_map(|(rgb, _)| rgb.iter().map(|v| v.exp())).collect();
    f64::from(tonemap::quantile(&radiance, 0.98)).ln()
}
