//! A scene built up: what a ray from the eye sees. MODEL (69).

mod below;

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::ambient::Ambient;
use super::layout::{Lamp, layout};
use super::material::Material;
use super::noise::fractal2;
use super::scene::Scene;
use super::sky::{Sky, spiral};
use super::solid::Hit;
use super::spectrum::luminance;
use super::view::{Thing, View};

/// Radiance of a lit window, kcd/m².
const WINDOW: Vec3 = Vec3::new(0.034, 0.023, 0.012);
/// Above this height the open sky lights things, below it what the viewer sees of it, metres.
const OPEN_HEIGHT: f32 = 14.0;

/// Irradiance of street lamps on the houses of a skyline, klx.
const TOWN: Vec3 = Vec3::new(0.009, 0.0055, 0.0022);
/// Lamps further away than this light nothing, metres.
const LAMP_REACH: f32 = 60.0;

/// Everything that a ray needs.
pub(super) struct SceneView<'a> {
    pub(super) scene: &'a Scene,
    pub(super) sky: Sky,
    view: View,
    pub(super) lamps: Vec<Lamp>,
    /// Sources that no ridge hides: irradiance and direction.
    sources: Vec<(Vec3, Vec3)>,
    street_light: Vec3,
    open: Ambient,
    near: Ambient,
}

impl<'a> SceneView<'a> {
    pub(super) fn new(scene: &'a Scene) -> Self {
        let sky = Sky::new(scene);
        let mut layout = layout(scene);
        let directions: Vec<_> = sky.sources.iter().map(|s| s.direction).collect();
        let view = View::new(scene, &mut layout, &directions);
        let hidden = |d: Vec3| view.ridges.first(scene.eye, d, f32::INFINITY, 0.0).is_some();
        let visible = |d: Vec3, e: Vec3| if d.z <= 0.0 || hidden(d) { Vec3::ZERO } else { e };
        let sources = sky.sources.iter().map(|s| (visible(s.direction, s.direct()), s.direction)).collect();
        let nothing = Ambient::new(&[]);
        let (lamps, street_light) = (layout.lamps, layout.street_light);
        let mut this =
            Self { scene, sky, view, lamps, sources, street_light, open: nothing.clone(), near: nothing };
        this.light_up();
        this
    }

    /// Finds the ambient light: of the open sky, and of the sky as the viewer sees it between things.
    fn light_up(&mut self) {
        let (mut open, mut near, mut seen) = (Vec::new(), Vec::new(), 0.0);
        let eye = Vec3::Z * self.scene.eye;
        let above: Vec<_> =
            spiral(160).map(|d| (d, self.sky.radiance(d, 0.15, 0.5), self.view.thing(eye, d, 0.1))).collect();
        let sky: Vec3 = above.iter().map(|(d, l, _)| *l * d.z).sum::<Vec3>() * (2.0 * PI / 160.0);
        let direct: Vec3 = self.sources.iter().map(|(e, d)| *e * d.z.max(0.0)).sum();
        let albedo = Vec3::from(self.scene.ground.albedo());
        for (d, radiance, thing) in &above {
            open.push((*d, *radiance));
            let wall = |albedo: f32| albedo / PI * (0.35 * sky + 0.2 * direct + 0.25 * albedo * direct);
            near.push((
                *d,
                match thing {
                    Thing::Sky => {
                        seen += 1.0 / 160.0;
                        *radiance
                    }
                    Thing::Leaves(_) => wall(0.12) + 0.05 * *radiance,
                    Thing::Slope(_) => *radiance * 0.3,
                    Thing::Solid(h) => {
                        wall(if matches!(self.view.solids.all[h.solid].material, Material::Leaves { .. }) {
                            0.1
                        } else {
                            0.28
                        })
                    }
                    Thing::Ground(_) => wall(0.2),
                },
            ));
        }
        // the ground below, in sun where the sky is open
        let bounce = |visible: f32| albedo / PI * (sky * visible + direct * visible);
        for d in spiral(160) {
            open.push((-d, bounce(1.0)));
            near.push((-d, bounce(seen)));
        }
        self.open = Ambient::new(&open);
        self.near = Ambient::new(&near);
    }

    /// Radiance along a ray from the eye; `footprint` is the angle that it stands for, `jitter` in 0..1 its place in
    /// clouds.
    pub(super) fn radiance(&self, direction: Vec3, footprint: f32, jitter: f32) -> Vec3 {
        let eye = Vec3::Z * self.scene.eye;
        self.look(eye, direction, footprint, jitter, true)
    }

    /// Whether nothing but air and cloud lies in a direction, up to `reach` metres.
    pub(super) fn is_clear(&self, direction: Vec3, reach: f32) -> bool {
        self.view.is_clear(direction, reach)
    }

    fn look(&self, eye: Vec3, direction: Vec3, footprint: f32, jitter: f32, mirrors: bool) -> Vec3 {
        match self.view.thing(eye, direction, footprint) {
            Thing::Sky => self.sky.radiance(direction, footprint, jitter),
            Thing::Solid(hit) => self.solid(eye, direction, hit, footprint, mirrors),
            Thing::Leaves(t) => self.leaves(eye + t * direction, direction),
            Thing::Slope(s) => {
                let e = self.irradiance_far(s.normal);
                let lit = if self.scene.lit && s.town {
                    s.albedo / PI * TOWN + s.shine * WINDOW
                } else {
                    Vec3::ZERO
                };
                let own = s.albedo / PI * e + lit;
                self.sky.through_air(own, direction, s.distance * 1e-3)
            }
            Thing::Ground(t) => self.ground(eye, direction, t, footprint, jitter, mirrors),
        }
    }

    /// Whether source `k` reaches a point.
    fn lit(&self, point: Vec3, k: usize) -> bool {
        let (light, towards) = self.sources[k];
        light.max_element() > 0.0 && self.view.reaches(point, k, towards)
    }

    /// Irradiance on a surface near the viewer, and what falls on its back from the sources. `weigh` multiplies the
    /// light from the direction of a source.
    fn irradiance(&self, point: Vec3, normal: Vec3, weigh: impl Fn(Vec3) -> f32) -> (Vec3, Vec3) {
        let (mut front, mut back) = (Vec3::ZERO, Vec3::ZERO);
        let start = point + normal * 0.02;
        for (k, (light, towards)) in self.sources.iter().enumerate() {
            let cosine = normal.dot(*towards);
            let from = if cosine > 0.0 { start } else { point - normal * 0.02 };
            if self.lit(from, k) {
                if cosine > 0.0 {
                    front += *light * cosine * weigh(*towards);
                } else {
                    back -= *light * cosine;
                }
            }
        }
        for lamp in &self.lamps {
            let to = lamp.position - point;
            let distance2 = to.length_squared().max(0.3);
            if distance2 > LAMP_REACH * LAMP_REACH {
                continue;
            }
            front += lamp.intensity * (normal.dot(to) / distance2.sqrt()).max(0.0) / distance2;
        }
        let open = (point.z / OPEN_HEIGHT).clamp(0.0, 1.0);
        front += self.street_light * (1.0 - 0.8 * open);

        front += self.near.at(normal).lerp(self.open.at(normal), open);
        (front, back)
    }

    fn irradiance_far(&self, normal: Vec3) -> Vec3 {
        let direct: Vec3 = self.sources.iter().map(|(e, d)| *e * normal.dot(*d).max(0.0)).sum();
        direct + self.open.at(normal) + self.street_light
    }

    fn solid(&self, eye: Vec3, direction: Vec3, hit: Hit, footprint: f32, mirrors: bool) -> Vec3 {
        let point = eye + hit.distance * direction;
        let solid = &self.view.solids.all[hit.solid];
        let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
        let (albedo, shine, mirror) =
            solid.material.paint(point, hit.normal, footprint * hit.distance, solid.seed);
        let (front, back) = self.irradiance(point, normal, |_| 1.0);
        let mut out = if let Material::Leaves { .. } = solid.material {
            // leaves face all ways, let light through, and shade each other more the deeper they sit
            let deep =
                if hit.normal.dot(direction) > 0.0 { 0.5 } else { 0.55 + 0.3 * hit.normal.z.max(-0.6) };
            let through = Vec3::new(0.8, 1.0, 0.35);
            albedo / PI * (front * deep + 0.5 * through * back)
        } else {
            albedo / PI * front
        };
        if shine > 0.0 {
            out += shine * WINDOW;
        }
        if mirror > 0.0 && mirrors {
            let reflected = direction - 2.0 * direction.dot(normal) * normal;
            if reflected.z > 0.0 {
                let strength =
                    mirror * (0.05 + 0.95 * (1.0 - normal.dot(-direction).clamp(0.0, 1.0)).powi(5));
                out += strength * self.sky.radiance(reflected, 0.1, 0.5);
            }
        }
        self.sky.through_air(out, direction, hit.distance * 1e-3)
    }

    /// The underside of a canopy: leaves against the light.
    fn leaves(&self, point: Vec3, direction: Vec3) -> Vec3 {
        let canopy = self.view.canopy.as_ref().map_or(Vec3::ZERO, |c| c.albedo);
        let dense = (0.9 * fractal2(Vec2::new(point.x, point.y) * 0.9, 4, 0.7, 0.0, 0x1eaf)).exp();
        let direct: Vec3 = self.sources.iter().map(|(e, d)| *e * d.z.max(0.0)).sum();
        let through = Vec3::new(0.75, 1.0, 0.3);
        let below = self.near.at(-Vec3::Z);
        let above = (direct + self.open.at(Vec3::Z)) * 0.035 * dense;
        let own = canopy / PI * (below + through * above);
        self.sky.through_air(own, direction, point.length() * 1e-3)
    }

    /// Brightness by which neighbouring samples are compared.
    pub(super) fn level(radiance: Vec3) -> f32 {
        luminance(radiance).max(1e-12)
    }
}
