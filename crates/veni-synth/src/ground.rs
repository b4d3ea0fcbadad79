//! The ground plane: which surface lies where, its texture, and water. MODEL (70).

use glam::{Vec2, Vec3};

use super::noise::{cell, fractal2};
use super::surface::{Ground, GroundMaterial, Pattern};

/// The ground at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub(super) albedo: Vec3,
    pub(super) normal: Vec3,
    /// Share of water.
    pub(super) water: f32,
}

impl Patch {
    fn times(self, share: f32) -> Self {
        Self { albedo: share * self.albedo, normal: share * self.normal, water: share * self.water }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            albedo: self.albedo + other.albedo,
            normal: self.normal + other.normal,
            water: self.water + other.water,
        }
    }
}

impl Ground {
    /// The ground at a point (metres), averaged over `footprint` metres.
    pub(super) fn at(&self, p: Vec2, footprint: f32) -> Patch {
        let share = self.second_share(p, footprint);
        let first = |share: f32| self.patch(self.surface, p, footprint, 0).times(share);
        let second = |share: f32| self.patch(self.second, p, footprint, 1).times(share);
        // most places are one or the other
        let mixed = match share {
            0.0 => first(1.0),
            1.0 => second(1.0),
            _ => first(1.0 - share).plus(second(share)),
        };
        Patch { albedo: self.tone * mixed.albedo, normal: mixed.normal.normalize(), water: mixed.water }
    }

    /// Share of the second surface.
    fn second_share(&self, p: Vec2, footprint: f32) -> f32 {
        let axis = Vec2::from_angle(self.bearing.to_radians());
        let seed = self.seed ^ 0x5ec0;
        let soft = |x: f32, width: f32| (0.5 + x / width.max(footprint)).clamp(0.0, 1.0);
        match self.pattern {
            Pattern::None => 0.0,
            Pattern::Patches => soft(fractal2(p / 9.0, 4, 0.6, footprint / 9.0, seed) - 0.1, 0.25),
            Pattern::Strip => {
                let share = if self.surface == GroundMaterial::Paving { 1.0 } else { 0.7 };
                let bend = 0.35 * fractal2(p / 14.0, 3, 0.5, footprint / 14.0, seed) * self.width.min(3.0);
                let across = axis.perp_dot(p) - self.offset;
                share * soft(self.width - across.abs() + bend, 0.3)
            }
            Pattern::Rows => {
                let bend = fractal2(p / 20.0, 2, 0.5, footprint / 20.0, seed) * self.width;
                let period = 2.0 * self.width;
                let across = (axis.perp_dot(p) - self.offset + bend) / period;
                // a wave through a box as wide as the footprint
                let seen = (1.0 - footprint / period).max(0.0);
                0.4 + 0.4 * seen * (std::f32::consts::TAU * across).sin()
            }
            Pattern::Shore => {
                let bend =
                    fractal2(p / 30.0, 4, 0.5, footprint / 30.0, seed) * (4.0 + 0.25 * self.width.abs());
                soft(axis.dot(p) - self.width + bend, 0.6)
            }
        }
    }

    fn patch(&self, surface: GroundMaterial, p: Vec2, footprint: f32, which: u32) -> Patch {
        let (size, contrast) = surface.texture();
        let contrast = contrast * self.contrast;
        let seed = self.seed ^ (which.wrapping_mul(0x9e37));
        if surface == GroundMaterial::Water {
            return Patch { albedo: surface.albedo(), normal: self.waves(p, footprint), water: 1.0 };
        }
        let v = fractal2(p / size, 6, 0.85, footprint / size, seed);
        let broad = fractal2(p / (9.0 * size), 3, 0.6, footprint / (9.0 * size), seed ^ 0xb4);
        let vast = fractal2(p / (50.0 * size), 3, 0.6, footprint / (50.0 * size), seed ^ 0xb5);
        let tiles = if surface == GroundMaterial::Paving { 0.5 * self.tiles(p, footprint) } else { 0.0 };
        let slope = |k: u32| contrast * 0.6 * fractal2(p / size, 4, 0.7, footprint / size, seed ^ k);
        let tint = Vec3::new(1.0 + 0.25 * contrast * broad, 1.0, 1.0 - 0.25 * contrast * broad);
        Patch {
            albedo: surface.albedo() * tint * (contrast * (0.8 * v + 1.2 * broad + 1.2 * vast + tiles)).exp(),
            normal: Vec3::new(slope(1), slope(2), 1.0).normalize(),
            water: 0.0,
        }
    }

    /// How tiles and joints deviate from the mean, where a sample resolves them.
    fn tiles(&self, p: Vec2, footprint: f32) -> f32 {
        let size = 0.4 + 0.5 * (self.seed % 7) as f32;
        let seen = 1.0 - footprint / size;
        if seen <= 0.0 {
            return 0.0;
        }
        let axis = Vec2::from_angle(self.bearing.to_radians());
        let q = Vec2::new(p.dot(axis), axis.perp_dot(p)) / size;
        let cut = q.floor();
        let joint = (q - cut - 0.5).abs().max_element() > 0.5 - 0.04 / size;
        seen * (1.4 * (cell(cut.x as i32, cut.y as i32, self.seed) - 0.5) - if joint { 1.0 } else { 0.0 })
    }

    /// Normal of the waves that a sample resolves.
    fn waves(&self, p: Vec2, footprint: f32) -> Vec3 {
        let slope = self.slope_deviation();
        // waves are longer in stronger wind
        let size = 0.6 + 0.35 * self.wind;
        let n = |k: u32| 1.6 * slope * fractal2(p / size, 3, 0.7, footprint / size, self.seed ^ k);
        Vec3::new(n(0x3a), n(0x3b), 1.0).normalize()
    }

    /// Deviation of the slope of waves along one axis (Cox & Munk 1954).
    pub(super) fn slope_deviation(&self) -> f32 {
        (0.5 * (0.003 + 0.005_12 * self.wind)).sqrt()
    }

    /// How much of the light from a source rough ground reflects, relative to a flat Lambert surface: its grains and
    /// blades show their shaded sides against the light, and hide their shadows in it. Directions point away.
    pub(super) fn facing(&self, to_eye: Vec3, to_source: Vec3) -> f32 {
        let low = (1.0 - to_source.z * to_source.z).max(0.0).sqrt();
        1.0 + self.roughness * low * (0.9 * to_eye.dot(to_source) - 0.1)
    }

    /// What is left of the light where one looks down between blades and grains, and at what stands under a camera;
    /// `down` is the sine of the ray's elevation.
    pub(super) fn depths(&self, down: f32) -> f32 {
        1.0 - self.hollow * down * down
    }
}

/// Radiance of the glitter of a source of irradiance 1 on facets whose slopes have this variance: the microfacet form of
/// Cox & Munk, shadowing left out. Directions point away from the surface.
pub(super) fn glitter(variance: f32, to_eye: Vec3, to_source: Vec3) -> f32 {
    let half = (to_eye + to_source).normalize_or(Vec3::Z);
    if half.z <= 0.05 || to_eye.z <= 1e-3 {
        return 0.0;
    }
    let slope2 = (1.0 - half.z * half.z) / (half.z * half.z);
    let density = (-0.5 * slope2 / variance).exp() / (2.0 * std::f32::consts::PI * variance);
    // the rougher the sea and the lower the eye, the more of it waves hide
    density * fresnel(half.dot(to_eye)) / (4.0 * (to_eye.z + 2.0 * variance.sqrt() * 0.3) * half.z.powi(4))
}

/// Reflectance of water (Schlick 1994).
pub(super) fn fresnel(cosine: f32) -> f32 {
    0.02 + 0.98 * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_vanish_at_a_distance_and_rough_ground_is_darker_against_the_light() {
        // a fixed ground, not a drawn one: how far its tones spread differs from seed to seed
        let rows = Ground {
            surface: GroundMaterial::Paving,
            second: GroundMaterial::Grass,
            pattern: Pattern::Rows,
            width: 0.8,
            roughness: 0.5,
            hollow: 0.4,
            bearing: -16.425_116,
            offset: 0.381_665_4,
            tone: 0.518_949_03,
            contrast: 1.889_106_8,
            sheen: 0.254_632_06,
            wind: 6.480_547,
            seed: 1_739_427_526,
        };
        let across = Vec2::from_angle(rows.bearing.to_radians()).perp();
        let deviation = |footprint: f32| {
            let values: Vec<f32> =
                (0..64).map(|k| rows.at(0.13 * k as f32 * across, footprint).albedo.y.ln()).collect();
            let mean = values.iter().sum::<f32>() / 64.0;
            (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / 64.0).sqrt()
        };
        let [near, far] = [0.05, 400.0].map(deviation);
        assert!(near > 0.25 && far < 1e-3, "{near} {far}");
        let low = Vec3::new(0.9, 0.0, 0.436);
        let [with, against] = [1.0, -1.0].map(|x| rows.facing(Vec3::new(0.9 * x, 0.0, 0.436), low));
        assert!(with > 1.2 && against < 0.85 && against > 0.0, "{with} {against}");
        assert!((rows.depths(-1.0) - 0.6).abs() < 1e-6 && rows.depths(0.0) == 1.0);
    }
}
