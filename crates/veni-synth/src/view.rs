//! What stands in the way of a ray from the eye.

use glam::{Vec2, Vec3};

use super::cloud::Cloud;
use super::layout::{Canopy, Layout};
use super::noise::fractal2;
use super::scene::Scene;
use super::solid::{Hit, Solids};
use super::terrain::{Ridges, Slope};

/// How much denser a canopy gets with every metre, as rays pass through more of it.
const CANOPY_CLOSES: f32 = 0.025;

/// Everything that can hide the sky but clouds.
pub(super) struct View {
    eye: Vec3,
    pub(super) solids: Solids,
    pub(super) canopy: Option<Canopy>,
    pub(super) ridges: Ridges,
}

/// What is on the way of a ray.
pub(super) enum Thing {
    Solid(Hit),
    Leaves(f32),
    Ground(f32),
    Slope(Slope),
    Sky,
}

impl View {
    /// `sources` are the directions that shadows are asked for.
    pub(super) fn new(scene: &Scene, layout: &mut Layout, sources: &[Vec3]) -> Self {
        Self {
            eye: Vec3::Z * scene.eye,
            solids: Solids::new(std::mem::take(&mut layout.solids), sources),
            canopy: layout.canopy,
            ridges: Ridges::new(scene.ridges.clone()),
        }
    }

    /// What a ray from the eye (or from above or below it) meets first; `footprint` is an angle.
    pub(super) fn thing(&self, eye: Vec3, direction: Vec3, footprint: f32) -> Thing {
        let down = if direction.z < -1e-5 { -eye.z / direction.z } else { f32::INFINITY };
        let run = Vec2::new(direction.x, direction.y).length();
        let hit = self.solids.first(eye, direction, down.min(2000.0));
        let solid = hit.map_or(f32::INFINITY, |h| h.distance);
        if let Some(t) = self.canopy.and_then(|c| c.meet(eye, direction))
            && t < solid
        {
            return Thing::Leaves(t);
        }
        if let Some(hit) = hit {
            return Thing::Solid(hit);
        }
        match self.ridges.first(eye.z, direction, down * run, footprint) {
            Some(slope) => Thing::Slope(slope),
            None if down.is_finite() => Thing::Ground(down),
            None => Thing::Sky,
        }
    }

    /// Whether nothing but air and cloud lies in a direction, up to `reach` metres.
    pub(super) fn is_clear(&self, direction: Vec3, reach: f32) -> bool {
        match self.thing(self.eye, direction, 0.0) {
            Thing::Sky => true,
            Thing::Solid(h) => h.distance > reach,
            Thing::Leaves(t) | Thing::Ground(t) => t > reach,
            Thing::Slope(s) => s.distance > reach,
        }
    }

    /// Whether the parallel light of source `k` reaches a point.
    pub(super) fn reaches(&self, point: Vec3, k: usize, towards: Vec3) -> bool {
        self.canopy.is_none_or(|c| c.meet(point, towards).is_none()) && self.solids.lit(point, k, towards)
    }
}

impl Canopy {
    /// Where a ray from below meets the leaves.
    fn meet(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        if direction.z <= 0.0 || origin.z >= self.height {
            return None;
        }
        // two layers: gaps close towards the horizon, as they do under trees
        for (k, lift) in [(0u32, 0.0f32), (1, 0.35)] {
            let t = (self.height * (1.0 + lift) - origin.z) / direction.z;
            let p = origin + t * direction;
            let p = Vec2::new(p.x, p.y);
            if p.length() > self.radius {
                continue;
            }
            let n = fractal2(p / self.scale, 5, 0.72, 0.0, self.seed ^ (k * 0x77));
            if n < self.threshold + CANOPY_CLOSES * p.length() {
                return Some(t);
            }
        }
        None
    }
}

/// The first of these azimuths (degrees) at which neither things nor cloud hide the sun of a scene, if any.
pub(super) fn sun_in_view(scene: &Scene, azimuths: impl Iterator<Item = f32>) -> Option<f32> {
    let view = View::new(scene, &mut super::layout::layout(scene), &[]);
    let clouds: Vec<_> = scene.clouds.iter().map(Cloud::new).collect();
    azimuths.into_iter().find(|azimuth| {
        let towards = super::scene::direction(*azimuth, scene.sun_elevation.max(0.1));
        let through: f32 = clouds.iter().map(|c| c.transmittance(towards)).product();
        through > 0.4 && view.is_clear(towards, f32::INFINITY)
    })
}
