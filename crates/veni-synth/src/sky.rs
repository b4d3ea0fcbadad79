//! The whole sky of a scene: clear domes, night, cloud layers, and the air in front of distant things.

use std::f32::consts::PI;

use glam::Vec3;

use super::atmosphere::{Atmosphere, MIE_HEIGHT, RAYLEIGH_HEIGHT};
use super::cloud::{Cloud, Lighting};
use super::dome::Dome;
use super::scene::Scene;
use super::spectrum::{SUN, Spectrum, luminance, to_rgb};

/// Sun or moon.
#[derive(Clone, Debug)]
pub(super) struct Source {
    /// Unit direction towards it.
    pub(super) direction: Vec3,
    /// Spectral irradiance above the atmosphere.
    spectrum: Spectrum,
    /// Irradiance at the ground on a surface that faces it, without clouds.
    pub(super) clear: Vec3,
    /// What clouds leave of it at the viewer.
    pub(super) through_cloud: f32,
}

/// The sky above a viewer.
#[derive(Clone, Debug)]
pub(super) struct Sky {
    pub(super) sources: Vec<Source>,
    domes: Vec<Dome>,
    clouds: Vec<Cloud>,
    /// Night sky, at the zenith.
    airglow: Vec3,
    /// Lights of towns, at the horizon.
    glow: Vec3,
    /// Extinction at sea level, per km: molecules and aerosol.
    extinction: [Vec3; 2],
    /// Mean radiance of the layers, which lights the air below them.
    below: Vec3,
    /// Share of the light from above that layers keep from the air below them.
    shade: f32,
}

/// Illuminance of the full moon relative to the sun.
const MOON: f32 = 2.1e-6;

impl Sky {
    pub(super) fn new(scene: &Scene) -> Self {
        let albedo = luminance(Vec3::from(scene.ground.albedo()));
        let air = Atmosphere::new(scene.turbidity, scene.ozone, albedo);
        let mut sources = vec![Source::new(&air, scene.sun_direction(), SUN)];
        if let Some(moon) = &scene.moon {
            // moonlight is sunlight, reddened a little by the moon's rock
            let reddening = [0.78, 0.86, 0.92, 0.97, 1.02, 1.07, 1.11, 1.15];
            let spectrum = std::array::from_fn(|k| SUN[k] * reddening[k] * MOON * moon.phase_factor());
            sources.push(Source::new(&air, moon.direction(), spectrum));
        }
        // below −18° the sun does not reach the air that is seen
        sources.retain(|s| s.direction.z > -0.31);
        let domes: Vec<_> = sources.iter().map(|s| Dome::new(&air, s.direction, &s.spectrum)).collect();
        let band = |coefficient: &Spectrum| Vec3::new(coefficient[5], coefficient[3], coefficient[1]);
        let mut this = Self {
            sources,
            domes,
            clouds: Vec::new(),
            airglow: Vec3::new(1.9e-7, 2.0e-7, 2.3e-7),
            glow: Vec3::from(scene.glow),
            extinction: [band(&air.rayleigh), band(&air.mie)],
            below: Vec3::ZERO,
            shade: 0.0,
        };
        let mean = this.mean_clear();
        let direct: Vec3 = this.sources.iter().map(|s| s.clear * s.direction.z.max(0.0)).sum();
        let ground = Vec3::from(scene.ground.albedo()) * (direct + PI * mean) / PI;
        let mut layers = scene.clouds.clone();
        layers.sort_by(|a, b| a.base.total_cmp(&b.base));
        // from the highest down: each one shades those below
        let (mut direct_left, mut clouds) = (1.0, Vec::new());
        for layer in layers.iter().rev() {
            let mut cloud = Cloud::new(layer);
            let lighting = |s: &Source| {
                let up = f64::from(s.direction.z);
                let there = air.to_sun(f64::from(layer.base + 0.5 * layer.thickness), up);
                let direct = to_rgb(&std::array::from_fn(|k| there[k] * s.spectrum[k])) * direct_left;
                Lighting { source: s.direction, direct, sky: Vec3::ZERO, ground: Vec3::ZERO }
            };
            cloud.lighting = this.sources.iter().map(lighting).collect();
            let fill = Lighting {
                source: Vec3::Z,
                direct: Vec3::ZERO,
                sky: mean * direct_left + this.airglow,
                ground: ground * direct_left + 0.8 * this.glow,
            };
            cloud.lighting.push(fill);
            let kept = layer.cover.min(1.0) * (1.0 - 1.0 / (1.0 + 0.11 * layer.depth));
            direct_left *= 1.0 - kept;
            clouds.insert(0, cloud);
        }
        this.clouds = clouds;
        this.shade = 1.0 - direct_left;
        this.below = this.mean_below();
        for k in 0..this.sources.len() {
            let towards = this.sources[k].direction;
            this.sources[k].through_cloud = this.clouds.iter().map(|c| c.transmittance(towards)).product();
        }
        this
    }

    /// Radiance towards a unit direction above the horizon, without the discs of sun, moon and stars. `footprint` is
    /// the angle that a sample stands for, `jitter` in 0..1 its place along rays through clouds.
    pub(super) fn radiance(&self, direction: Vec3, footprint: f32, jitter: f32) -> Vec3 {
        let direction = above(direction);
        let clear = self.clear(direction);
        let (mut radiance, mut through) = (Vec3::ZERO, 1.0);
        for cloud in &self.clouds {
            if through < 0.005 {
                break;
            }
            if let Some(g) = cloud.gather(direction, footprint, jitter) {
                let height = cloud.layer().base;
                let air = self.air_transmittance(g.distance, height);
                // the cloud through the air before it; where it is opaque, that air hides no sky
                radiance += through
                    * (g.radiance * air + (1.0 - g.transmittance) * self.airlight(direction) * (1.0 - air));
                through *= g.transmittance;
            }
        }
        radiance + through * clear
    }

    /// The share of light from a direction that gets through all layers.
    pub(super) fn transmittance(&self, direction: Vec3) -> f32 {
        self.clouds.iter().map(|c| c.transmittance(direction)).product()
    }

    /// `radiance` of something at `distance` km and about the height of the viewer, seen through the air.
    pub(super) fn through_air(&self, radiance: Vec3, direction: Vec3, distance: f32) -> Vec3 {
        let air = self.air_transmittance(distance, 0.0);
        let level = Vec3::new(direction.x, direction.y, 0.0).normalize_or(Vec3::X);
        radiance * air + self.airlight(level + 0.03 * Vec3::Z) * (1.0 - air)
    }

    /// Radiance of an endless path through the air.
    fn airlight(&self, direction: Vec3) -> Vec3 {
        self.clear(above(direction)).lerp(self.below, self.shade)
    }

    /// Koschmieder's law over a straight path of `distance` that climbs to `height`, km.
    fn air_transmittance(&self, distance: f32, height: f32) -> Vec3 {
        let path = |scale: f32| {
            let x = height / scale;
            if x < 1e-3 { distance } else { distance * (1.0 - (-x).exp()) / x }
        };
        let depth = self.extinction[0] * path(RAYLEIGH_HEIGHT) + self.extinction[1] * path(MIE_HEIGHT);
        Vec3::new((-depth.x).exp(), (-depth.y).exp(), (-depth.z).exp())
    }

    /// The sky without clouds.
    fn clear(&self, direction: Vec3) -> Vec3 {
        let day: Vec3 = self.domes.iter().map(|d| d.radiance(direction)).sum();
        let up = direction.z.max(0.0);
        // van Rhijn: a thin layer at 90 km; the glow of towns falls off within some ten degrees
        let layer = 1.0 / (1.0 - (1.0 - up * up) * 0.972).sqrt();
        day + self.airglow * layer.min(3.0) + self.glow * (0.05 + (-up * 7.0).exp())
    }

    /// Mean radiance of the cloudless sky, weighted by the cosine from the zenith.
    fn mean_clear(&self) -> Vec3 {
        spiral(64).map(|d| self.clear(d) * d.z).sum::<Vec3>() / 32.0
    }

    fn mean_below(&self) -> Vec3 {
        let ring = (0..12).map(|k| {
            let (s, c) = (k as f32 / 12.0 * 2.0 * PI).sin_cos();
            Vec3::new(c, s, 0.35).normalize()
        });
        let seen = |d: Vec3| {
            let (mut radiance, mut through) = (Vec3::ZERO, 1.0);
            for g in self.clouds.iter().filter_map(|c| c.gather(d, 0.05, 0.5)) {
                radiance += through * g.radiance;
                through *= g.transmittance;
            }
            radiance + through * self.clear(d)
        };
        ring.map(seen).sum::<Vec3>() / 12.0
    }
}

impl Source {
    fn new(air: &Atmosphere, direction: Vec3, spectrum: Spectrum) -> Self {
        let t = air.to_sun(0.0, f64::from(direction.z));
        let clear = to_rgb(&std::array::from_fn(|k| t[k] * spectrum[k]));
        Self { direction, spectrum, clear, through_cloud: 1.0 }
    }

    /// Irradiance at the viewer on a surface that faces it.
    pub(super) fn direct(&self) -> Vec3 {
        self.clear * self.through_cloud
    }
}

fn above(direction: Vec3) -> Vec3 {
    if direction.z > 0.0 {
        direction
    } else {
        Vec3::new(direction.x, direction.y, 1e-4).normalize_or(Vec3::X)
    }
}

/// `n` directions that cover the upper hemisphere evenly (a Fibonacci spiral).
pub(super) fn spiral(n: usize) -> impl Iterator<Item = Vec3> {
    (0..n).map(move |k| {
        let z = (k as f32 + 0.5) / n as f32;
        let (s, c) = (2.399_963 * k as f32).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * c, r * s, z)
    })
}
