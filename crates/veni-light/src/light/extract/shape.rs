//! What a light looks like: its radius and where that comes from, its kind, whether it was cut off. LIGHT (4) to (6).

use super::level::View;
use super::measure::Measured;
use crate::compact::{CompactLight, RadiusSource};
use crate::luminance::luminance;

/// A disc of fewer pixels than this in radius has perhaps no pixel that it fills: its peak says nothing about its radiance.
const FILLS: f64 = 1.3;
/// Below this many pixels the spread over pixels is that of the pixels.
const SEEN: f64 = 0.9;
/// Values within this ratio are the same.
const EQUAL: f32 = 1e-3;
/// Largest values that files and their conversions stop at: sRGB's white, bytes, half precision, 16 bits.
const CEILINGS: [f32; 4] = [1.0, 255.0, 65504.0, 65535.0];
/// A flat top more than this much brighter than what surrounds it is a disc, not a value that was cut off.
const CUT: f64 = 200.0;

/// Angular radius in radians of a light of energy `energy` and of a radiance of `peak` above its background (luminances), whose
/// core has the variance `spread` about its middle.
pub(super) fn radius(energy: f64, peak: f64, spread: f64, pixel: f64) -> (f64, RadiusSource) {
    use std::f64::consts::PI;
    // a disc of the peak's radiance: cos r = 1 − E/(2πL)
    let filled = (1.0 - (energy / (2.0 * PI * peak))).clamp(-1.0, 1.0).acos();
    if filled >= FILLS * pixel {
        return (filled, RadiusSource::Measured);
    }
    // of a disc ⟨θ²⟩ = r²/2, to which a square pixel adds a²/6
    let square = 2.0 * (spread - pixel * pixel / 6.0);
    if square >= (SEEN * pixel).powi(2) {
        return (square.sqrt(), RadiusSource::Measured);
    }
    let one_pixel = pixel / PI.sqrt();
    (f64::from(CompactLight::SUN_RADIUS).min(one_pixel), RadiusSource::Assumed)
}

/// The largest luminance in the cap, and whether it was cut off: the brightest three pixels or more are all the same, and at a
/// value at which files stop, or hardly brighter than what surrounds them.
pub(super) fn top(pixels: View<'_>, measured: &Measured) -> (f64, bool) {
    let (mut top, mut colour) = (0.0, [0.0; 3]);
    pixels.cap(measured.centre, measured.scale, |cell| {
        if luminance(cell.radiance) > top {
            (top, colour) = (luminance(cell.radiance), cell.radiance);
        }
    });
    let same = |a: f32, b: f32| (a - b).abs() <= EQUAL * b.abs();
    let mut flat = 0;
    pixels.cap(measured.centre, measured.scale, |cell| {
        flat += usize::from(cell.radiance.iter().zip(colour).all(|(a, b)| same(*a, b)));
    });
    let ceiling = colour.iter().any(|v| CEILINGS.iter().any(|c| v == c));
    let dim = f64::from(top) < CUT * measured.background_luminance();
    (f64::from(top), flat >= 3 && (ceiling || dim))
}
