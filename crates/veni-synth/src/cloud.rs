//! Cloud layers: fractal density on a spherical shell above the viewer, lit by sun, sky and ground. MODEL (67).
//!
//! **Cumulus** (and stratocumulus) has a flat base and tops that rise where the cloud is dense; rays march through
//! it and towards the sun. **Stratus** (and cirrus, altocumulus, altostratus) is thin enough to be a surface of
//! optical depth. Within cloud, light scattered many times is taken from the two-stream solution, 1 / (1 + ¾ (1 − g) τ)
//! with g = 0.85 (Bohren, Am. J. Phys. 1987), light scattered once from Henyey–Greenstein lobes. The brightness of a
//! closed stratus layer over elevation γ follows Moon & Spencer (1942), (1 + 2 sin γ).

mod stratus;

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::cloud_layer::{CloudKind, CloudLayer};
use super::dome::henyey_greenstein;
use super::noise::{billows3, fractal2};

/// Radius of the earth, km.
const EARTH: f32 = 6360.0;
/// ¾ (1 − g).
const DIFFUSION: f32 = 0.11;
/// Samples of a ray inside cumulus.
const STEPS: usize = 10;

/// What lights a layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lighting {
    /// Towards the sun or moon.
    pub(super) source: Vec3,
    /// Irradiance of the source on a surface facing it, at the layer.
    pub(super) direct: Vec3,
    /// Mean radiance of the sky above the layer.
    pub(super) sky: Vec3,
    /// Radiance that the ground reflects upwards.
    pub(super) ground: Vec3,
}

/// A layer, ready to be looked at.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    layer: CloudLayer,
    axis: Vec2,
    offset: Vec2,
    threshold: f32,
    pub(super) lighting: Vec<Lighting>,
}

/// What a ray gathers in a layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gathered {
    /// Radiance of the cloud itself.
    pub(super) radiance: Vec3,
    /// What is left of the light behind it.
    pub(super) transmittance: f32,
    /// How far away it is, km.
    pub(super) distance: f32,
}

impl Cloud {
    pub(super) fn new(layer: &CloudLayer) -> Self {
        let axis = Vec2::from_angle(layer.wind);
        let mut this = Self {
            layer: layer.clone(),
            axis,
            // far from the origin of the noise, where every seed looks alike
            offset: Vec2::new(37.7, -91.3),
            threshold: 0.0,
            lighting: Vec::new(),
        };
        // so that `cover` is what it says, whatever the distribution of the noise
        let mut samples: Vec<f32> = (0..400)
            .map(|k| {
                let p = Vec2::new((k % 20) as f32, (k / 20) as f32) * 1.37 * layer.scale;
                this.field(p, 0.0)
            })
            .collect();
        samples.sort_unstable_by(f32::total_cmp);
        let at = ((1.0 - layer.cover).clamp(0.0, 1.0) * 399.0) as usize;
        this.threshold = if layer.cover >= 0.999 { samples[0] - 1.0 } else { samples[at] };
        this
    }

    pub(super) fn layer(&self) -> &CloudLayer {
        &self.layer
    }

    /// The noise that says where there is cloud; `p` and `footprint` in km.
    fn field(&self, p: Vec2, footprint: f32) -> f32 {
        let d = &self.layer;
        let along = p.dot(self.axis) / d.stretch;
        let q = Vec2::new(along, p.perp_dot(self.axis)) / d.scale + self.offset;
        let footprint = footprint / d.scale;
        let octaves = if d.kind == CloudKind::Cumulus { 3 } else { 6 };
        let mut v = if d.stretch > 1.5 {
            // fibres bend
            let bend = fractal2(q * 0.6, 2, 0.5, footprint * 0.6, d.seed ^ 0x51);
            fractal2(q + Vec2::new(0.0, 0.7 * bend), octaves, 0.52, footprint, d.seed)
        } else {
            fractal2(q, octaves, if octaves > 3 { 0.52 } else { 0.5 }, footprint, d.seed)
        };
        if d.cells > 0.0 {
            let cells = fractal2(q * 7.0, 2, 0.4, footprint * 7.0, d.seed ^ 0xce11);
            v += d.cells * 0.6 * cells;
        }
        v
    }

    /// Density in cumulus, 0 to 1, at `p` (km) and `level` (0 at the base, 1 at the highest tops), and the level of
    /// the top there.
    fn density(&self, p: Vec2, level: f32, footprint: f32, fine: bool) -> (f32, f32) {
        if !(0.0..1.0).contains(&level) {
            return (0.0, 0.0);
        }
        let d = &self.layer;
        let rise = 3.0 * (self.field(p, footprint) - self.threshold);
        let inside = rise - 0.9 * level * level.sqrt();
        let most = 0.9 * d.ragged;
        if inside < -most {
            return (0.0, 0.0);
        }
        let size = 2.6 / d.scale;
        let q = Vec3::new(p.x * size, p.y * size, level * d.thickness * size * 1.3);
        let lumps = billows3(q, if fine { 2 } else { 1 }, d.seed ^ 0xb1);
        let rim = (level * 9.0).min(1.0);
        let top = ((rise + most * lumps).max(0.0) / 0.9).powf(2.0 / 3.0).min(1.0);
        (((inside + most * lumps) * 1.8).clamp(0.0, 1.0) * rim, top)
    }

    /// Distance to height `h` along a ray with sine `up` of its elevation, km.
    fn reach(h: f32, up: f32) -> f32 {
        let a = EARTH * up;
        // the difference of two large numbers, without cancellation
        let c = 2.0 * EARTH * h + h * h;
        c / (a + (a * a + c).sqrt())
    }

    /// Looks along a unit direction above the horizon. `footprint` is the angle that a sample stands for, `jitter`
    /// in 0..1 shifts the samples along the ray.
    pub(super) fn gather(&self, direction: Vec3, footprint: f32, jitter: f32) -> Option<Gathered> {
        match self.layer.kind {
            CloudKind::Cumulus => self.gather_cumulus(direction, footprint, jitter),
            CloudKind::Stratus => self.gather_stratus(direction, footprint),
        }
    }

    /// Transmittance alone, for light that comes from this direction.
    pub(super) fn transmittance(&self, direction: Vec3) -> f32 {
        self.gather(direction, 0.0, 0.5).map_or(1.0, |g| g.transmittance)
    }

    fn gather_cumulus(&self, direction: Vec3, footprint: f32, jitter: f32) -> Option<Gathered> {
        let d = &self.layer;
        let up = direction.z.max(0.0);
        let (near, far) = (Self::reach(d.base, up), Self::reach(d.base + d.thickness, up));
        let length = (far - near) / STEPS as f32;
        let sigma = d.depth / d.thickness;
        let (mut radiance, mut through, mut distance) = (Vec3::ZERO, 1.0, 0.0);
        for k in 0..STEPS {
            let t = near + (k as f32 + jitter) * length;
            let height = t * up + t * t * (1.0 - up * up) / (2.0 * EARTH);
            let level = (height - d.base) / d.thickness;
            let p = Vec2::new(direction.x, direction.y) * t;
            let width = footprint * t;
            let (density, top) = self.density(p, level, width, width < 0.3 * d.scale);
            if density <= 0.0 {
                continue;
            }
            let step = (-density * sigma * length).exp();
            let share = through * (1.0 - step);
            radiance += share * self.lit(direction, p, [level, top], density);
            distance += share * t;
            through *= step;
            if through < 0.01 {
                through = 0.0;
                break;
            }
        }
        let opaque = 1.0 - through;
        (opaque > 1e-4).then(|| Gathered { radiance, transmittance: through, distance: distance / opaque })
    }

    /// Source function inside cumulus.
    fn lit(&self, direction: Vec3, p: Vec2, [level, top]: [f32; 2], density: f32) -> Vec3 {
        let d = &self.layer;
        let sigma = d.depth / d.thickness;
        let mut light = Vec3::ZERO;
        for l in &self.lighting {
            let towards = Vec2::new(l.source.x, l.source.y);
            let (mut depth, mut last) = (0.0, 0.0);
            if l.direct.max_element() > 0.0 {
                for reach in [0.08f32, 0.22, 0.5, 1.1] {
                    let s = reach * d.thickness;
                    let mid = 0.5 * (s + last);
                    let density =
                        self.density(p + towards * mid, level + l.source.z * mid / d.thickness, 0.0, false);
                    depth += density.0 * sigma * (s - last);
                    last = s;
                }
            }
            let cosine = direction.dot(l.source);
            let once = 0.7 * henyey_greenstein(0.8, cosine) * (-depth).exp()
                + 0.3 * henyey_greenstein(0.5, cosine) * (-0.25 * depth).exp();
            // thin edges have not scattered light often enough to be white
            let often = 0.62 / PI / (1.0 + DIFFUSION * depth) * (0.35 + 0.65 * density);
            light += l.direct * (once + often);
            let above = (top - level).max(0.0) * d.depth;
            light += l.sky * 0.75 / (1.0 + DIFFUSION * above);
            light += l.ground * 0.5 * (1.0 - level);
        }
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(kind: CloudKind, cover: f32) -> CloudLayer {
        CloudLayer {
            kind,
            base: 1.2,
            thickness: 0.8,
            cover,
            depth: 25.0,
            scale: 1.5,
            stretch: 1.0,
            wind: 0.3,
            ragged: 0.4,
            cells: 0.0,
            seed: 11,
        }
    }

    /// Share of a layer of this seed whose noise is above the threshold, over 20 × 20 of its features; and share of it
    /// that has cloud at any height.
    fn share(kind: CloudKind, cover: f32, seed: u32) -> [f32; 2] {
        const SIDE: usize = 60;
        let cloud = Cloud::new(&CloudLayer { seed, ..layer(kind, cover) });
        let (mut above, mut cloudy) = (0, 0);
        for k in 0..SIDE * SIDE {
            let p =
                Vec2::new((k % SIDE) as f32, (k / SIDE) as f32) * (20.0 / SIDE as f32 * cloud.layer.scale);
            above += usize::from(cloud.field(p, 0.0) > cloud.threshold);
            cloudy +=
                usize::from((1..8).any(|level| cloud.density(p, level as f32 / 8.0, 0.0, true).0 > 0.0));
        }
        [above, cloudy].map(|n| n as f32 / (SIDE * SIDE) as f32)
    }

    #[test]
    fn cover_is_the_share_of_the_layer_that_is_cloud() {
        let seeds = 16;
        for kind in [CloudKind::Stratus, CloudKind::Cumulus] {
            for cover in [0.0, 0.1, 0.3, 0.6, 0.9, 1.0] {
                let all: Vec<_> = (0..seeds).map(|seed| share(kind, cover, seed)).collect();
                let mean = |k: usize| all.iter().map(|s| s[k]).sum::<f32>() / seeds as f32;
                // 16 layers of 400 features: some 0.005
                let means = [mean(0), mean(1)];
                assert!(means.iter().all(|m| (m - cover).abs() < 0.015), "{kind:?} {cover}: {means:?}");
                // one layer alone: its features are few
                for [one, _] in &all {
                    let (low, high) =
                        ((cover - 0.09).max(0.45 * cover), (cover + 0.09).min(1.6 * cover + 0.01));
                    assert!((low..=high).contains(one), "{kind:?} {cover}: {one}");
                }
            }
        }
    }

    #[test]
    fn rays_meet_a_shell() {
        assert!((Cloud::reach(1.0, 1.0) - 1.0).abs() < 1e-4);
        assert!((Cloud::reach(1.0, 0.0) - (2.0 * EARTH + 1.0).sqrt()).abs() < 1e-2);
        assert!((Cloud::reach(2.0, 0.5) - 4.0).abs() < 1e-2);
    }

    #[test]
    fn thick_cloud_hides_the_sun_and_is_as_bright_as_snow_at_most() {
        let mut cloud = Cloud::new(&layer(CloudKind::Cumulus, 1.0));
        cloud.lighting = vec![Lighting {
            source: Vec3::new(0.6, 0.0, 0.8),
            direct: Vec3::splat(100.0),
            sky: Vec3::splat(4.0),
            ground: Vec3::splat(5.0),
        }];
        let up = Vec3::new(0.1, 0.3, 0.95).normalize();
        let g = cloud.gather(up, 0.01, 0.5).unwrap();
        assert!(g.transmittance < 0.01 && (1.0..2.0).contains(&g.distance), "{g:?}");
        // a white Lambert surface under this light has about 30 kcd/m²
        assert!(g.radiance.x > 3.0 && g.radiance.x < 35.0, "{g:?}");
    }
}
