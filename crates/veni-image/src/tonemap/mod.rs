//! From radiance to 8-bit sRGB.
//!
//! Two curves: [`Tonemap::reference`] is what the LDR metrics of the paper use (its own 98 % quantile becomes
//! white, sRGB curve, clamped), and [`Tonemap::filmic`] is for previews that people look at.

pub mod srgb;

pub use srgb::{srgb, srgb_derivative, srgb_of_log, srgb_to_linear};

use super::Panorama;

/// The quantile that [`Tonemap::reference`] shows as white.
pub const REFERENCE_QUANTILE: f64 = 0.98;

/// Middle grey, the luminance that [`Tonemap::filmic`] gives to the panorama's geometric mean.
pub const MIDDLE_GREY: f32 = 0.18;

/// A scale followed by a curve, ready to be applied pixel by pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tonemap {
    /// Multiplies radiance before the curve.
    pub scale: f32,
    /// What happens to scaled radiance.
    pub curve: Curve,
}

/// The curve of a [`Tonemap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// The sRGB transfer function, clamped to [0, 1].
    Srgb,
    /// Hable's filmic curve (J. Hable, "Filmic Tonemapping Operators", GDC 2010) with white at 11.2, per channel,
    /// then the sRGB transfer function.
    Filmic,
}

impl Tonemap {
    /// The paper's: radiance divided by its own 98 % quantile over all values.
    pub fn reference(image: &Panorama) -> Self {
        let white = quantile(image.pixels().as_flattened(), REFERENCE_QUANTILE).max(f32::MIN_POSITIVE);
        Self { scale: 1.0 / white, curve: Curve::Srgb }
    }

    /// Filmic with automatic exposure: the solid-angle-weighted geometric mean luminance becomes middle grey,
    /// then `stops` more (a factor of 2 each).
    pub fn filmic(image: &Panorama, stops: f32) -> Self {
        let mean = image.mean_log_luminance().exp().max(f32::MIN_POSITIVE);
        Self { scale: MIDDLE_GREY / mean * stops.exp2(), curve: Curve::Filmic }
    }

    /// One linear pixel to display values in [0, 1].
    pub fn apply(&self, pixel: [f32; 3]) -> [f32; 3] {
        pixel.map(|v| {
            let v = v * self.scale;
            srgb(match self.curve {
                Curve::Srgb => v,
                Curve::Filmic => filmic(v),
            })
            .clamp(0.0, 1.0)
        })
    }

    /// One linear pixel to 8 bits per channel, rounded to nearest.
    pub fn apply_u8(&self, pixel: [f32; 3]) -> [u8; 3] {
        self.apply(pixel).map(|v| (v * 255.0 + 0.5) as u8)
    }
}

/// Radiance to the LDR space of the paper's metrics: divided by its own 98 % quantile over all values, sRGB
/// curve, clamped to [0, 1]. Returns the values and the quantile.
///
/// # Panics
/// If there are no values.
pub fn srgb_q98(values: &[f32]) -> (Vec<f32>, f32) {
    let white = quantile(values, REFERENCE_QUANTILE);
    (values.iter().map(|v| srgb(v / white).clamp(0.0, 1.0)).collect(), white)
}

/// The q-quantile of the values, linear between order statistics at q(n − 1).
///
/// # Panics
/// If there are no values, or q lies outside [0, 1].
pub fn quantile(values: &[f32], q: f64) -> f32 {
    assert!(!values.is_empty() && (0.0..=1.0).contains(&q), "quantile {q} of {} values", values.len());
    let mut values = values.to_vec();
    let at = q * (values.len() - 1) as f64;
    let (below, fraction) = (at.floor() as usize, (at - at.floor()) as f32);
    let (_, &mut low, rest) = values.select_nth_unstable_by(below, f32::total_cmp);
    let high = rest.iter().copied().min_by(f32::total_cmp).unwrap_or(low);
    low + (high - low) * fraction
}

fn filmic(v: f32) -> f32 {
    // shoulder, linear strength, linear angle, toe strength, toe numerator, toe denominator
    const A: f32 = 0.15;
    const B: f32 = 0.50;
    const C: f32 = 0.10;
    const D: f32 = 0.20;
    const E: f32 = 0.02;
    const F: f32 = 0.30;
    const WHITE: f32 = 11.2;
    let curve = |x: f32| (x * (A * x + C * B) + D * E) / (x * (A * x + B) + D * F) - E / F;
    // beyond white the result is clamped anyway, and x² must not overflow
    let v = v.clamp(0.0, WHITE);
    // a factor of 2 as in the original presentation, so that middle grey stays near the middle
    curve(2.0 * v) / curve(WHITE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn quantiles_of_small_sets() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0], 0.25), 1.25);
        assert_eq!(quantile(&[5.0], 0.98), 5.0);
        assert_eq!(quantile(&[4.0, 1.0], 1.0), 4.0);
    }

    #[test]
    fn both_curves_are_monotonic_and_bounded() {
        let grid = Equirect::new(16, 8);
        let image = Panorama::from_fn(grid, |[x, _, z]| [(3.0 * x).exp(), (2.0 * z).exp(), 1.0]);
        for map in [Tonemap::reference(&image), Tonemap::filmic(&image, 0.0)] {
            let mut last = -1.0;
            for k in 0..200 {
                let v = map.apply([1e-4 * 1.2f32.powi(k); 3])[0];
                assert!((0.0..=1.0).contains(&v) && v >= last, "{map:?}: {v} after {last}");
                last = v;
            }
            assert_eq!(map.apply_u8([1e30; 3]), [255; 3]);
            assert_eq!(map.apply_u8([0.0; 3]), [0; 3]);
        }
    }

    #[test]
    fn the_reference_shows_its_quantile_as_white() {
        let values: Vec<f32> = (0..1000).map(|k| k as f32).collect();
        let (shown, white) = srgb_q98(&values);
        assert!((white - 979.02).abs() < 1e-3);
        assert!((shown[979] - 1.0).abs() < 1e-4 && shown[980] == 1.0 && shown[0] == 0.0);
    }
}
