//! Rays through cloud layers without height. MODEL (68).

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::{Cloud, DIFFUSION, EARTH, Gathered};
use crate::dome::henyey_greenstein;

impl Cloud {
    pub(super) fn gather_stratus(&self, direction: Vec3, footprint: f32) -> Option<Gathered> {
        let d = &self.layer;
        let up = direction.z.max(0.0);
        let distance = Self::reach(d.base, up);
        let p = Vec2::new(direction.x, direction.y) * distance;
        // towards the horizon a sample covers more ground along the ray than across
        let tilt = (up * up + 2.0 * d.base / EARTH).sqrt().min(1.0);
        let width = footprint * distance * (0.5 + 0.5 / tilt);
        let v = self.field(p, width);
        let edge = ((v - self.threshold) / (0.5 + 0.7 * d.ragged)).clamp(0.0, 1.0);
        let depth = d.depth * edge * edge * (3.0 - 2.0 * edge) * (1.4 * d.ragged * v).exp();
        if depth < 1e-3 {
            return None;
        }
        let slant = depth / tilt;
        let transmittance = (-slant).exp();
        let seen = 1.0 - transmittance;
        let mut radiance = Vec3::ZERO;
        for l in &self.lighting {
            let sun = l.source.z.max(0.0);
            let tilt_sun = (sun * sun + 2.0 * d.base / EARTH).sqrt().min(1.0);
            let cosine = direction.dot(l.source);
            let once = (0.75 * henyey_greenstein(0.82, cosine) + 0.25 * henyey_greenstein(0.1, cosine))
                * (-0.18 * depth / tilt_sun).exp();
            let flux = (l.direct * tilt_sun.max(sun) + PI * l.sky) / PI;
            let often = flux / (1.0 + DIFFUSION * depth / tilt_sun.max(0.3)) * 3.0 / 7.0 * (1.0 + 2.0 * up);
            // thin stratus scatters once, thick often
            let thick = 1.0 - (-0.5 * depth).exp();
            radiance += seen
                * (l.direct * once + often * thick + l.sky * 0.5 * (1.0 - thick) + l.ground * 0.3 * thick);
        }
        Some(Gathered { radiance, transmittance, distance })
    }
}
