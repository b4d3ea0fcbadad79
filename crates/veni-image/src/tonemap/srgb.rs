//! The sRGB transfer function (IEC 61966-2-1) with the paper's constants, its inverse and its derivatives.

/// Up to this linear value the curve is a line.
pub const KNEE: f64 = 0.003_130_8;
/// The line's factor.
pub const SLOPE: f64 = 12.92;
/// The power's factor.
pub const SCALE: f64 = 1.055;
/// What is subtracted of the power.
pub const OFFSET: f64 = 0.055;
/// The power's exponent is 1 over this.
pub const GAMMA: f64 = 2.4;

/// 12.92 v up to 0.0031308, else 1.055 v^(1/2.4) − 0.055. Not clamped.
pub fn srgb(v: f32) -> f32 {
    if v <= KNEE as f32 {
        SLOPE as f32 * v
    } else {
        SCALE as f32 * v.powf(1.0 / GAMMA as f32) - OFFSET as f32
    }
}

/// The derivative of [`srgb`] by v.
pub fn srgb_derivative(v: f64) -> f64 {
    if v <= KNEE { SLOPE } else { SCALE / GAMMA * v.powf(1.0 / GAMMA - 1.0) }
}

/// [`srgb`] of min(eˣ, 1), and its derivative by x: the display value of a log radiance whose white is 0.
pub fn srgb_of_log(x: f64) -> (f64, f64) {
    if x >= 0.0 {
        return (1.0, 0.0);
    }
    let linear = x.exp();
    if linear <= KNEE {
        return (SLOPE * linear, SLOPE * linear);
    }
    let curved = SCALE * linear.powf(1.0 / GAMMA);
    (curved - OFFSET, curved / GAMMA)
}

/// The inverse of [`srgb`] for v in [0, 1].
pub fn srgb_to_linear(v: f32) -> f32 {
    if v <= SLOPE as f32 * KNEE as f32 {
        v / SLOPE as f32
    } else {
        ((v + OFFSET as f32) / SCALE as f32).powf(GAMMA as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_inverts_and_is_continuous() {
        for k in 0..=100 {
            let v = k as f32 / 100.0;
            assert!((srgb_to_linear(srgb(v)) - v).abs() < 1e-5);
        }
        assert!((srgb(0.003_130_8) - srgb(0.003_131)).abs() < 1e-5);
    }

    /// Metrics and fits depend on the rounding of the literals.
    #[test]
    fn constants_are_rounded_once() {
        for v in [-0.5_f32, 0.0, 0.001, 0.003_130_8, 0.003_130_801, 0.02, 0.3, 0.999, 1.0, 7.0] {
            let curve = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
            let inverse = if v <= 12.92 * 0.003_130_8 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
            assert_eq!((srgb(v), srgb_to_linear(v)), (curve, inverse), "{v}");
        }
    }

    #[test]
    fn every_form_is_the_same_curve_and_its_derivative() {
        for x in [-9.0, -6.5, -5.0, -2.0, -0.7, -0.01] {
            let v = f64::exp(x);
            let (value, by_log) = srgb_of_log(x);
            assert!((value - f64::from(srgb(v as f32))).abs() < 1e-6, "{x}");
            assert!((by_log - srgb_derivative(v) * v).abs() < 1e-12, "{x}");
            let step = 1e-5;
            let difference = (srgb_of_log(x + step).0 - srgb_of_log(x - step).0) / (2.0 * step);
            assert!((by_log - difference).abs() < 1e-7, "{x}: {by_log} {difference}");
        }
        assert_eq!(srgb_of_log(0.5), (1.0, 0.0));
        assert_eq!(srgb_derivative(0.0), 12.92);
    }
}
