//! The angle of a point in the plane, faster than the standard library's and as exact as f32 needs.

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::hint::select_unpredictable;

use crate::sphere::Equirect;

/// atan2(y, x) within 3e-7, 0 at the origin. Which octant a direction lies in is as good as random, so that nothing branches on it:
/// tan of at most an eighth turn, by an odd minimax polynomial (error 4e-8).
#[inline]
pub(super) fn atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let t = ax.min(ay) / ax.max(ay).max(f32::MIN_POSITIVE);
    let s = t * t;
    let q = s * s;
    let (a, b) = (0.999_999_34 - 0.333_298_62 * s, 0.199_465_66 - 0.139_086_29 * s);
    let (c, d) = (0.096_421_95 - 0.055_912_29 * s, 0.021_862_93 - 0.004_054_558_6 * s);
    let angle = t * ((a + b * q) + (c + d * q) * (q * q));
    let angle = select_unpredictable(ay > ax, FRAC_PI_2 - angle, angle);
    select_unpredictable(x < 0.0, PI - angle, angle).copysign(y)
}

/// acos(z) of a unit vector's z: by its root and a polynomial (Abramowitz & Stegun 4.4.46), and near a pole, where an f32 close
/// to 1 says little about the angle, by the other two components. Within 5e-7.
#[inline]
fn polar([x, y, z]: [f32; 3]) -> f32 {
    let t = z.abs();
    if t > NEAR_POLE {
        return atan2((x * x + y * y).sqrt(), z);
    }
    let (s, q) = (t * t, t * t * t * t);
    let (a, b) = (FRAC_PI_2 - 0.214_598_8 * t, 0.088_978_99 - 0.050_174_303 * t);
    let (c, d) = (0.030_891_88 - 0.017_088_126 * t, 0.006_670_09 - 0.001_262_491_1 * t);
    let angle = (1.0 - t).sqrt() * ((a + b * s) + (c + d * s) * q);
    select_unpredictable(z < 0.0, PI - angle, angle)
}

/// From here on, 18° from a pole, rounding of z moves the angle by more than the polynomial does.
const NEAR_POLE: f32 = 0.95;

/// [`Equirect::pixel`] of a unit direction, fast, within 1e-7 of the grid's width.
#[inline]
pub(super) fn pixel(grid: Equirect, [x, y, z]: [f32; 3]) -> [f32; 2] {
    [(PI - atan2(y, x)) * (grid.width as f32 / TAU), polar([x, y, z]) * (grid.height as f32 / PI)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_standard_library() {
        for k in 0..200_000 {
            let angle = (k as f64 / 100_000.0 - 1.0) * std::f64::consts::PI;
            for r in [1.0, 1e-4, 3e5] {
                let (y, x) = ((r * angle.sin()) as f32, (r * angle.cos()) as f32);
                let expected = f64::from(y).atan2(f64::from(x));
                assert!(
                    (f64::from(atan2(y, x)) - expected).abs() < 4e-7,
                    "{y} {x}: {} for {expected}",
                    atan2(y, x)
                );
            }
        }
        assert_eq!([atan2(0.0, 0.0), atan2(0.0, 1.0), atan2(0.0, -1.0)], [0.0, 0.0, PI]);
    }

    #[test]
    fn polar_angles_are_those_of_the_standard_library() {
        for k in 0..=200_000 {
            let angle = f64::from(k) / 200_000.0 * std::f64::consts::PI;
            let azimuth = f64::from(k) * 0.7;
            let d = [angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos()].map(|c| c as f32);
            let [x, y, z] = d.map(f64::from);
            let expected = x.hypot(y).atan2(z);
            assert!((f64::from(polar(d)) - expected).abs() < 5e-7, "{d:?}: {} for {expected}", polar(d));
        }
    }
}
