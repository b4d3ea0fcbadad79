//! What lies below the horizon: ground, water, and the mirrored sky of scenes without either.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::SceneView;
use crate::ground::{fresnel, glitter};
use crate::scene::Setting;

/// Variance of the slopes of ground that shines.
const SHEEN_VARIANCE: f32 = 0.06;
/// Sine of the depression below which a mirrored sky has lost all detail.
const BROAD_BELOW: f32 = 0.5;

impl SceneView<'_> {
    pub(super) fn ground(
        &self,
        eye: Vec3,
        direction: Vec3,
        t: f32,
        footprint: f32,
        jitter: f32,
        mirrors: bool,
    ) -> Vec3 {
        if self.scene.setting == Setting::PureSky {
            return self.mirrored_sky(direction, footprint, jitter);
        }
        let point = eye + t * direction;
        // a sample reaches further along the ray than across
        let grazing = (-direction.z).max(1e-3);
        let width = footprint * t * (0.4 + 0.6 / grazing.sqrt());
        let patch = self.scene.ground.at(Vec2::new(point.x, point.y), width);
        let ground = &self.scene.ground;
        let (front, _) = self.irradiance(point, patch.normal, |towards| ground.facing(-direction, towards));
        let mut out = patch.albedo * ground.depths(direction.z) / PI * front;
        if ground.sheen > 0.0 && patch.water < 1.0 {
            out += ground.sheen * self.sheen(point, direction);
        }
        if patch.water > 0.0 && mirrors {
            let to_eye = -direction;
            let mut reflected = direction - 2.0 * direction.dot(patch.normal) * patch.normal;
            // a wave that turns the ray down shows another wave, which shows the sky near the horizon
            reflected.z = reflected.z.abs().max(0.01);
            let reflected = reflected.normalize();
            let origin = point.with_z(0.02);
            // rough water mirrors the sky of steeper rays: the mean over slopes that face the viewer
            let cosine = (to_eye.dot(patch.normal).max(0.0) + 0.6 * ground.slope_deviation()).min(1.0);
            let mut mirrored = fresnel(cosine) * self.reflected(origin, reflected, footprint, jitter);
            for (k, (light, towards)) in self.sources.iter().enumerate() {
                if self.lit(origin, k) {
                    mirrored += *light * glitter(ground.slope_deviation().powi(2), to_eye, *towards);
                }
            }
            out = out.lerp(mirrored + out, patch.water);
        }
        self.sky.through_air(out, direction, t * 1e-3)
    }

    /// What a smooth but uneven surface mirrors: the sky without detail, and the sun as a broad streak.
    fn sheen(&self, point: Vec3, direction: Vec3) -> Vec3 {
        let cosine = (-direction.z + 0.6 * SHEEN_VARIANCE.sqrt()).min(1.0);
        let reflected = Vec3::new(direction.x, direction.y, 0.3 - direction.z).normalize();
        let mut out = fresnel(cosine) * self.near.at(reflected) / PI;
        for (k, (light, towards)) in self.sources.iter().enumerate() {
            let strength = glitter(SHEEN_VARIANCE, -direction, *towards);
            if strength > 1e-4 && self.lit(point + 0.02 * Vec3::Z, k) {
                out += *light * strength;
            }
        }
        out
    }

    /// The sky mirrored at the horizon, more blurred and darker further down.
    fn mirrored_sky(&self, direction: Vec3, footprint: f32, jitter: f32) -> Vec3 {
        let down = -direction.z;
        let up = Vec3::new(direction.x, direction.y, down);
        let dim = 1.0 - 0.82 * down;
        // far down nothing but the broadest features is left
        let broad = (down / BROAD_BELOW).min(1.0);
        let mut out = broad * self.open.at(up.with_z(down + 0.2).normalize()) / PI;
        if broad < 1.0 {
            let (across, along) = up.any_orthonormal_pair();
            let blur = 0.04 + 0.4 * down;
            for k in 0..4 {
                let (s, c) = (std::f32::consts::TAU * (k as f32 + jitter) / 4.0).sin_cos();
                let turned = up + blur * (c * across + s * along);
                let turned = turned.with_z(turned.z.abs()).normalize();
                out += 0.25 * (1.0 - broad) * self.sky.radiance(turned, footprint + blur, jitter);
            }
        }
        dim * out
    }

    /// What water shows: things near the shore in the plane of the ray, else the sky.
    fn reflected(&self, origin: Vec3, direction: Vec3, footprint: f32, jitter: f32) -> Vec3 {
        // seen from the mirror image of the eye the ray starts on the axis, as the lists of solids need it
        let flat = Vec2::new(direction.x, direction.y).length();
        let run = Vec2::new(origin.x, origin.y).length();
        let eye = Vec3::new(0.0, 0.0, origin.z - run / flat.max(1e-4) * direction.z);
        let from =
            self.view.solids.first(eye, direction, 2000.0).filter(|h| (eye + h.distance * direction).z > 0.0);
        match from {
            Some(hit) => self.solid(eye, direction, hit, footprint, false),
            None => match self.view.ridges.first(self.scene.eye, direction, f32::INFINITY, footprint) {
                Some(s) => {
                    let own = s.albedo / PI * self.irradiance_far(s.normal);
                    self.sky.through_air(own, direction, s.distance * 1e-3)
                }
                None => self.sky.radiance(direction, footprint.max(0.03), jitter),
            },
        }
    }
}
