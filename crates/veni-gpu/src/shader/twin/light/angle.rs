//! `light_angle.wgsl` and `turns.wgsl`

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use super::LightTwin;

/// (sin 2πt, cos 2πt).
pub(super) fn sin_cos(t: f32) -> [f32; 2] {
    let (sin, cos) = (std::f64::consts::TAU * f64::from(t)).sin_cos();
    [sin as f32, cos as f32]
}

/// atan2 within 3e-7, 0 at the origin.
pub(super) fn atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = (ax.min(ay), ax.max(ay));
    let reduced = low > 0.414_213_57 * high;
    let (n, d) = if reduced { (low - high, low + high) } else { (low, high) };
    let t = n / d.max(1e-37);
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

impl LightTwin {
    /// A direction of the packed light, as the rotated scene has it.
    pub fn veni_light_rotated(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [s, c] = self.packed.uniform.rotation;
        [x * c - y * s, y * c + x * s, z]
    }

    /// And back.
    pub fn veni_light_unrotated(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [s, c] = self.packed.uniform.rotation;
        [x * c + y * s, y * c - x * s, z]
    }
}
