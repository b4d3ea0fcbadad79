//! Radiance for what is clipped: the expand map, then the sun. MODEL (62).

use super::{Analysis, Parameters, Region, SUN_RADIUS, Sun};
use veni_image::{Panorama, luminance};
use veni_light::sphere::Equirect;

/// The panorama with its range rebuilt.
pub(super) fn rebuild(analysis: &Analysis, parameters: &Parameters) -> (Panorama, Option<Sun>) {
    let mut out = analysis.linear().clone();
    let exponents: Vec<f64> = analysis.regions().iter().map(|r| parameters.exponent(&r.features)).collect();
    let sun = analysis.sun_region();
    let grid = out.grid();
    let mut energy = 0.0;
    for (pixel, region, x) in analysis.pixels() {
        let map = (exponents[region] * f64::from(x)).exp() as f32;
        // at the border the region goes on with the colour outside, towards the middle it turns to its own white
        let stored = analysis.linear().pixels()[pixel];
        let edge = analysis.border(pixel).map_or(stored, |k| analysis.linear().pixels()[k]);
        let mixed = |c: usize| 1.0 + (edge[c].max(stored[c]) - 1.0).max(0.0) / map;
        let value = [0, 1, 2].map(|c| map * mixed(c));
        out.pixels_mut()[pixel] = value;
        if Some(region) == sun {
            energy += f64::from(luminance(value)) * grid.solid_angle(pixel / grid.width);
        }
    }
    let Some(region) = sun.map(|k| &analysis.regions()[k]) else { return (out, None) };
    let missing = parameters.mean_radiance(&region.features) * region.solid_angle - energy;
    if missing <= parameters.faintest * energy {
        return (out, None);
    }
    add_disc(&mut out, region, missing, parameters.colour(region.centre[2]));
    (out, Some(Sun { direction: region.centre, energy: missing }))
}

/// Adds a disc of the sun's size at the region's centre: `energy` is ∫ L dω of its luminance.
fn add_disc(out: &mut Panorama, region: &Region, energy: f64, colour: [f32; 3]) {
    let covered = disc(out.grid(), region.centre);
    let total: f64 = covered.iter().map(|(_, weight)| weight).sum();
    let grid = out.grid();
    for (pixel, weight) in covered {
        let radiance = (energy * weight / total / grid.solid_angle(pixel / grid.width)) as f32;
        for (value, tint) in out.pixels_mut()[pixel].iter_mut().zip(colour) {
            *value += radiance * tint;
        }
    }
}

/// The pixels that a disc of the sun's size meets, with the part of it that each holds: points on concentric circles.
fn disc(grid: Equirect, centre: [f32; 3]) -> Vec<(usize, f64)> {
    const CIRCLES: usize = 8;
    let [x, y, z] = centre.map(f64::from);
    // two tangents: along the meridian and along the circle of latitude
    let level = x.hypot(y);
    let east = if level > 1e-9 { [-y / level, x / level, 0.0] } else { [0.0, 1.0, 0.0] };
    let north = [-z * east[1], z * east[0], x * east[1] - y * east[0]];
    let mut hits = std::collections::BTreeMap::new();
    for circle in 0..CIRCLES {
        let radius = SUN_RADIUS * ((circle as f64 + 0.5) / CIRCLES as f64);
        let points = 8 * (2 * circle + 1);
        for k in 0..points {
            let (sin, cos) = (2.0 * std::f64::consts::PI * k as f64 / points as f64).sin_cos();
            let at = [0, 1, 2].map(|i| [x, y, z][i] + radius * (cos * east[i] + sin * north[i]));
            let [column, row] = grid.pixel(at.map(|v| v as f32));
            let pixel =
                (row as usize).min(grid.height - 1) * grid.width + (column as usize).min(grid.width - 1);
            *hits.entry(pixel).or_insert(0.0) += 1.0;
        }
    }
    hits.into_iter().collect()
}
