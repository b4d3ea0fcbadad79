//! The angle of a point in the plane, faster than the standard library's and as exact as f32 needs.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use crate::sphere::Equirect;

/// atan2(y, x) within 3e-7, 0 at the origin.
#[inline]
pub(super) fn atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = (ax.min(ay), ax.max(ay));
    // tan of an eighth turn less: arguments within ±tan(π/8)
    let reduced = low > 0.414_213_57 * high;
    let (n, d) = if reduced { (low - high, low + high) } else { (low, high) };
    let t = if d > 0.0 { n / d } else { 0.0 };
    let s = t * t;
    let odd = ((0.080_537_4 * s - 0.138_776_85) * s + 0.199_777_11) * s - 0.333_329_5;
    let mut angle = odd * s * t + t;
    if reduced {
        angle += FRAC_PI_4;
    }
    if ay > ax {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    angle.copysign(y)
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
    if z < 0.0 { PI - angle } else { angle }
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
