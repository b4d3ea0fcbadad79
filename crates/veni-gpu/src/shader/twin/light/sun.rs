//! `light_sun.wgsl`

use super::angle::sin_cos;
use super::{LightTwin, VeniLightSample};

impl LightTwin {
    /// A direction within the sun's disc, its density over the disc, the sun's radiance. Without a sun the density is 0.
    pub fn veni_sun(&self, u: [f32; 2]) -> VeniLightSample {
        let Some(sun) = self.packed.uniform.lights.first().filter(|_| self.packed.uniform.has_sun) else {
            return VeniLightSample { direction: [0.0, 0.0, 1.0], pdf: 0.0, radiance: [0.0; 3] };
        };
        let direction = self.veni_light_rotated(self.on_sun(u));
        let radiance = sun.irradiance.map(|e| sun.per_solid_angle * e);
        VeniLightSample { direction, pdf: sun.per_solid_angle, radiance }
    }

    /// A direction of the disc before the rotation, even in solid angle.
    pub(super) fn on_sun(&self, [u, v]: [f32; 2]) -> [f32; 3] {
        let uniform = &self.packed.uniform;
        let sun = uniform.lights.first().copied().unwrap_or_default();
        let drop = uniform.cap * u;
        let tilt = (drop * (2.0 - drop)).sqrt();
        let [s, c] = sin_cos(v);
        let [a, b] = uniform.across;
        let d = [0, 1, 2].map(|i| (1.0 - drop) * sun.direction[i] + tilt * (c * a[i] + s * b[i]));
        let length = d.iter().map(|v| v * v).sum::<f32>().sqrt();
        d.map(|v| v / length)
    }

    /// Whether a direction before the rotation lies within the disc.
    pub(super) fn in_sun(&self, own: [f32; 3]) -> bool {
        let uniform = &self.packed.uniform;
        let Some(sun) = uniform.lights.first().filter(|_| uniform.has_sun) else { return false };
        let square: f32 = own.iter().zip(sun.direction).map(|(a, b)| (a - b) * (a - b)).sum();
        0.5 * square <= uniform.cap
    }
}
