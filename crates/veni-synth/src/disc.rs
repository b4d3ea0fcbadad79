//! Sun, moon, stars and lamps: small lights whose energy is put into the pixels they fall on, whatever the resolution.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::atmosphere::SUN_RADIUS;
use super::random::{Draw, Part};
use super::scene_view::SceneView;
use veni_light::sphere::Equirect;

/// Points on a disc that is smaller than a pixel.
const LEAST_POINTS: usize = 96;
/// Points per pixel of a disc that is larger.
const POINTS_PER_PIXEL: f64 = 24.0;
/// Radius of a lamp, metres.
const LAMP_RADIUS: f32 = 0.14;

/// Adds them to the pixels, row-major radiance.
pub(super) fn add_discs(view: &SceneView<'_>, grid: Equirect, pixels: &mut [Vec3]) {
    let mut splat = |direction: Vec3, illuminance: Vec3| {
        let [column, row] = grid.pixel(direction.to_array());
        let (column, row) = ((column as usize).min(grid.width - 1), (row as usize).min(grid.height - 1));
        pixels[row * grid.width + column] += illuminance / grid.solid_angle(row) as f32;
    };
    for source in &view.sky.sources {
        let phase = if source.direction == view.scene.sun_direction() {
            0.0
        } else {
            view.scene.moon.map_or(0.0, |m| m.phase)
        };
        let points: Vec<_> = disc(source.direction, SUN_RADIUS as f32, grid, phase)
            // what lies below the horizon is already missing from the irradiance
            .filter(|(d, _)| d.z > 0.0)
            .collect();
        let total: f32 = points.iter().map(|p| p.1).sum();
        for (direction, weight) in points {
            if view.is_clear(direction, f32::INFINITY) {
                splat(direction, source.clear * view.sky.transmittance(direction) * weight / total);
            }
        }
    }
    for lamp in &view.lamps {
        let to = lamp.position - Vec3::Z * view.scene.eye;
        let distance = to.length();
        let illuminance = lamp.intensity / (distance * distance);
        let points: Vec<_> = disc(to / distance, (LAMP_RADIUS / distance).min(0.2), grid, 0.0).collect();
        let total: f32 = points.iter().map(|p| p.1).sum();
        for (direction, weight) in points {
            if view.is_clear(direction, distance) {
                splat(direction, illuminance * weight / total);
            }
        }
    }
    if view.scene.sun_elevation < -5.0 {
        for (direction, illuminance) in stars(view) {
            if view.is_clear(direction, f32::INFINITY) {
                splat(direction, illuminance * view.sky.transmittance(direction));
            }
        }
    }
}

/// Points spread evenly over a disc with the weight of a limb-darkened one (Pierce & Slaughter 1977 at 550 nm, linear);
/// of a moon only what its phase shows.
fn disc(centre: Vec3, radius: f32, grid: Equirect, phase: f32) -> impl Iterator<Item = (Vec3, f32)> {
    let pixel = grid.solid_angle(grid.height / 2);
    let covered = f64::from(PI * radius * radius) / pixel;
    let count = LEAST_POINTS.max((covered * POINTS_PER_PIXEL) as usize);
    let (across, up) = centre.any_orthonormal_pair();
    let terminator = -phase.to_radians().cos();
    (0..count).filter_map(move |k| {
        let r = ((k as f32 + 0.5) / count as f32).sqrt();
        let (s, c) = (2.399_963 * k as f32 % TAU).sin_cos();
        let (x, y) = (r * c, r * s);
        if x < terminator * (1.0 - y * y).max(0.0).sqrt() {
            return None;
        }
        let weight = 1.0 - 0.6 * (1.0 - (1.0 - r * r).sqrt());
        Some(((centre + radius * (x * across + y * up)).normalize(), weight))
    })
}

/// Stars down to magnitude 6.5, as many of each as there are (Allen's Astrophysical Quantities: log N grows by 0.51
/// per magnitude), evenly over the sky.
fn stars(view: &SceneView<'_>) -> Vec<(Vec3, Vec3)> {
    let mut draw = Draw::new(view.scene.seed, view.scene.index, Part::Stars);
    (0..4000)
        .map(|_| {
            let magnitude = 6.5 + draw.unit().max(1e-4).log10() / 0.51;
            let z = draw.unit();
            let azimuth = draw.azimuth();
            let r = (1.0 - z * z).sqrt();
            let colour = draw.range(-0.25, 0.25);
            let tint = Vec3::new(1.0 + colour, 1.0, 1.0 - colour);
            // 2.54e-6 lx from a star of magnitude 0; a third is lost per air mass
            let klx = 2.54e-9 * 10f32.powf(-0.4 * magnitude) * 0.75f32.powf(1.0 / (z + 0.03));
            (Vec3::new(r * azimuth.cos(), r * azimuth.sin(), z), tint * klx)
        })
        .collect()
}
