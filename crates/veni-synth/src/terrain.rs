//! Lines of hills, mountains, woods and roofs: a height over azimuth at one distance each.

use glam::{Vec2, Vec3};

use super::noise::{cell, fractal2, noise2};
use super::scene::{Ridge, RidgeKind};
use super::surface::GroundMaterial;

/// Ridges from near to far.
#[derive(Clone, Debug)]
pub(super) struct Ridges(Vec<Ridge>);

/// Where a ray meets a ridge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    pub(super) distance: f32,
    pub(super) albedo: Vec3,
    pub(super) normal: Vec3,
    /// How much of a lit window is there, 0 to 1.
    pub(super) shine: f32,
    /// Whether it stands in a town, which lights itself at night.
    pub(super) town: bool,
}

impl Ridges {
    pub(super) fn new(mut ridges: Vec<Ridge>) -> Self {
        ridges.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        Self(ridges)
    }

    /// The first ridge in a direction, if nearer than `reach` metres along the ground. `footprint` is an angle.
    pub(super) fn first(&self, eye: f32, direction: Vec3, reach: f32, footprint: f32) -> Option<Slope> {
        let flat = Vec2::new(direction.x, direction.y);
        let run = flat.length();
        if run < 1e-4 {
            return None;
        }
        let (flat, rise) = (flat / run, direction.z / run);
        for ridge in self.0.iter().take_while(|r| r.distance < reach) {
            let z = eye + rise * ridge.distance;
            if z < 0.0 || z > ridge.height * (1.0 + 2.0 * ridge.relief) {
                continue;
            }
            let height = profile(ridge, flat, footprint);
            if z < height {
                return Some(slope(ridge, flat, z, height, footprint));
            }
        }
        None
    }
}

/// Height in the horizontal unit direction `flat`. On a circle, so there is no seam.
fn profile(ridge: &Ridge, flat: Vec2, footprint: f32) -> f32 {
    let n = match ridge.kind {
        RidgeKind::Hills => fractal2(flat * 1.3, 5, 0.4, footprint * 1.3, ridge.seed),
        RidgeKind::Mountains => {
            // ridged: sharp tops, broad valleys
            let n = fractal2(flat * 1.6, 7, 0.52, footprint * 1.6, ridge.seed);
            0.8 - 1.8 * n.abs() + 0.6 * fractal2(flat * 0.8, 1, 0.5, 0.0, ridge.seed ^ 0x77)
        }
        RidgeKind::Trees => {
            let f = ridge.distance / (0.55 * ridge.height);
            let crowns = 1.2 - 2.8 * noise2(flat * f, ridge.seed).abs();
            let groups = fractal2(flat * 2.5, 3, 0.6, footprint * 2.5, ridge.seed ^ 0x7ee5);
            0.55 * crowns + 0.8 * groups
        }
        RidgeKind::Town => {
            let (block, _) = house(ridge, flat);
            let quarter = fractal2(flat * 2.0, 2, 0.5, 0.0, ridge.seed ^ 0x70);
            let tower = if cell(block, 5, ridge.seed) > 0.93 { 1.2 } else { 0.0 };
            1.4 * cell(block, 1, ridge.seed) - 0.7 + 0.6 * quarter + tower
        }
    };
    // a wood or a town ends somewhere
    let stands = match ridge.kind {
        RidgeKind::Trees | RidgeKind::Town if ridge.gaps > 0.0 => {
            let n = fractal2(flat * 1.1, 4, 0.55, footprint * 1.1, ridge.seed ^ 0x6a95);
            ((n + 0.9 * (1.0 - 2.0 * ridge.gaps)) * 5.0 + 0.5).clamp(0.0, 1.0)
        }
        _ => 1.0,
    };
    stands * ridge.height * (1.0 + ridge.relief * n.clamp(-2.0, 2.0)).max(0.0)
}

/// Which house of a skyline, and where on its front (0 to 1).
fn house(ridge: &Ridge, flat: Vec2) -> (i32, f32) {
    let houses = (std::f32::consts::TAU * ridge.distance / 17.0).round().max(8.0);
    let at = (flat.y.atan2(flat.x) / std::f32::consts::TAU + 0.5) * houses;
    ((at.floor() as i32).rem_euclid(houses as i32), at.fract())
}

fn slope(ridge: &Ridge, flat: Vec2, z: f32, height: f32, footprint: f32) -> Slope {
    let seed = ridge.seed ^ 0x510e;
    let towards = (-flat).extend(0.0);
    let aside = flat.perp().extend(0.0);
    // in metres along the ridge and up
    let p = flat * ridge.distance;
    let place = Vec2::new(p.x + 0.7 * z, p.y - 0.6 * z);
    let width = footprint * ridge.distance;
    let rough = |size: f32, k: u32| fractal2(place / size, 3, 0.6, width / size, seed ^ k);
    match ridge.kind {
        RidgeKind::Hills | RidgeKind::Mountains => {
            let jagged = ridge.kind == RidgeKind::Mountains;
            let (size, relief) = if jagged { (0.35 * ridge.height, 0.8) } else { (0.8 * ridge.height, 0.4) };
            let lean = if jagged { 0.8 } else { 0.45 };
            let normal = towards * (lean + 0.4 * relief * rough(size, 1))
                + Vec3::Z * 0.8
                + aside * relief * rough(size, 2);
            let wood = rough(0.5 * ridge.height, 3);
            let mut albedo = ridge.surface.albedo() * (0.4 * wood).exp();
            if jagged && normal.z < 0.85 * normal.length() {
                albedo = albedo.lerp(GroundMaterial::Rock.albedo(), 0.7);
            }
            let snow = z - ridge.snow_line + 0.25 * ridge.height * rough(0.3 * ridge.height, 4);
            if snow > 0.0 {
                albedo = albedo.lerp(GroundMaterial::Snow.albedo(), (snow / (0.1 * ridge.height)).min(1.0));
            }
            Slope {
                distance: ridge.distance * (1.0 + 0.3 * z / height.max(1.0)),
                albedo,
                normal: normal.normalize(),
                shine: 0.0,
                town: false,
            }
        }
        RidgeKind::Trees => {
            let size = 0.3 * ridge.height;
            let normal =
                towards * 0.6 + Vec3::Z * (0.3 + 0.5 * rough(size, 1)) + aside * 0.9 * rough(size, 2);
            let albedo = ridge.surface.albedo() * (0.5 * rough(size, 3) - 0.15).exp();
            Slope {
                distance: ridge.distance,
                albedo,
                normal: normal.normalize_or(towards),
                shine: 0.0,
                town: false,
            }
        }
        RidgeKind::Town => {
            let (block, along) = house(ridge, flat);
            let tone = 0.12 + 0.4 * cell(block, 2, ridge.seed);
            let warm = cell(block, 3, ridge.seed);
            let albedo = tone * Vec3::new(1.0, 0.82 + 0.16 * warm, 0.62 + 0.34 * warm);
            // windows, where they are larger than a sample
            let (u, v) = ((along * 6.0).floor() as i32, (z / 3.2).floor() as i32);
            let seen = (1.0 - width / 3.0).clamp(0.0, 1.0);
            let on = cell(u + 7 * block, v, ridge.seed ^ 0x11) < 0.3;
            let glass = 0.25 * seen * if cell(u + 7 * block, v, ridge.seed ^ 0x12) < 0.5 { 1.0 } else { 0.3 };
            let shine = if on { 0.3 * seen } else { 0.05 * (1.0 - seen) };
            // two orientations of fronts
            let turn = if warm > 0.5 { 0.6 } else { -0.6 };
            let normal = (towards + turn * aside).normalize();
            Slope { distance: ridge.distance, albedo: albedo * (1.0 - glass), normal, shine, town: true }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [RidgeKind; 4] = [RidgeKind::Hills, RidgeKind::Mountains, RidgeKind::Trees, RidgeKind::Town];

    fn ridge(kind: RidgeKind, distance: f32, gaps: f32, seed: u32) -> Ridge {
        let (height, relief, surface, snow_line) = (40.0, 0.5, GroundMaterial::Grass, f32::INFINITY);
        Ridge { kind, distance, height, relief, surface, gaps, snow_line, seed }
    }

    fn around(count: usize) -> impl Iterator<Item = Vec2> {
        // not at whole degrees, where houses of a skyline end
        (0..count).map(move |k| Vec2::from_angle(TURN * (k as f32 + 0.37) / count as f32))
    }

    const TURN: f32 = std::f32::consts::TAU;

    #[test]
    fn heights_vary_about_their_mean_within_twice_the_relief_and_close_the_circle() {
        for kind in KINDS {
            let (mut mean, mut different) = (0.0, 0);
            for seed in 0..20 {
                let ridge = ridge(kind, 800.0, 0.0, seed);
                let heights: Vec<_> = around(720).map(|flat| profile(&ridge, flat, 0.0)).collect();
                // 1 ± 2 · 0.5 of 40 m
                assert!(heights.iter().all(|h| (0.0..=80.0).contains(h)), "{kind:?}, seed {seed}");
                mean += heights.iter().sum::<f32>() / 720.0 / 20.0;
                let spread = heights.iter().fold(0f32, |m, h| m.max((h - heights[0]).abs()));
                different += usize::from(spread > 4.0);
                // no seam where the azimuth jumps from 180° to −180°; houses have edges everywhere
                let [a, b] = [-1e-4f32, 1e-4].map(|y| profile(&ridge, Vec2::new(-1.0, y).normalize(), 0.0));
                assert!((a - b).abs() < 1.0 || kind == RidgeKind::Town, "{kind:?}, seed {seed}: {a} and {b}");
            }
            // 40 m; mountains, woods and towns rise above it a little
            assert!((38.0..50.0).contains(&mean) && different == 20, "{kind:?}: {mean} m, {different} of 20");
        }
    }

    #[test]
    fn gaps_open_the_horizon() {
        for kind in [RidgeKind::Trees, RidgeKind::Town] {
            // measured with this noise over 20 seeds; the documentation of `gaps` says them
            for (gaps, open) in [(0.0, 0.0), (0.3, 0.09), (0.5, 0.41), (0.7, 0.8), (1.0, 0.99)] {
                let mut low = 0;
                for seed in 0..20 {
                    let ridge = ridge(kind, 300.0, gaps, seed);
                    // a tenth of its mean height
                    low += around(360).filter(|flat| profile(&ridge, *flat, 0.0) <= 4.0).count();
                }
                let found = low as f32 / 7200.0;
                assert!((found - open).abs() < 0.06, "{kind:?}, {gaps}: {found}");
            }
        }
    }

    #[test]
    fn rays_end_on_the_nearest_ridge_that_is_high_enough() {
        for kind in KINDS {
            let (near, far) = (ridge(kind, 500.0, 0.0, 1), ridge(RidgeKind::Hills, 2000.0, 0.0, 2));
            let far = Ridge { height: 400.0, ..far };
            // in any order
            let ridges = Ridges::new(vec![far, near]);
            for flat in around(90) {
                let eye = 2.0;
                let towards = |z: f32, distance: f32| (flat * distance).extend(z - eye).normalize();
                let top = profile(&near, flat, 0.0);
                if top > 1.0 {
                    let slope = ridges.first(eye, towards(0.9 * top, 500.0), f32::INFINITY, 0.0).unwrap();
                    // slopes lean back by 0.3 of their height at most
                    assert!((500.0..=650.0).contains(&slope.distance), "{kind:?}: {slope:?}");
                    assert!((slope.normal.length() - 1.0).abs() < 1e-5);
                    assert!(
                        slope.albedo.min_element() >= 0.0 && slope.albedo.max_element() < 0.95,
                        "{slope:?}"
                    );
                    // and not where the ground is nearer
                    assert!(ridges.first(eye, towards(0.9 * top, 500.0), 400.0, 0.0).is_none());
                }
                // over the near one
                let above = (1.01 * top).max(0.5);
                let over = ridges.first(eye, towards(above, 500.0), f32::INFINITY, 0.0);
                assert!(over.is_none_or(|s| s.distance >= 2000.0), "{kind:?}: {over:?}");
                assert!(ridges.first(eye, Vec3::Z, f32::INFINITY, 0.0).is_none());
            }
        }
    }
}
