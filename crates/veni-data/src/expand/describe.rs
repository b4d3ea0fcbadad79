//! What is known about a clipped region, and can tell how bright it was.

use std::f64::consts::PI;

use super::SUN_RADIUS;
use super::nearest::{Angles, NOWHERE, nearest_outside};
use super::regions::OUTSIDE;
use super::scene::Scene;
use veni_image::Panorama;
use veni_light::vector::length;

/// Number of [`Region::features`].
pub const FEATURES: usize = 8;

/// The narrowest ring that a region's surroundings are judged by, radians.
const RING: f64 = 0.03;

/// A region that is clipped in all three channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Its solid angle, steradians.
    pub solid_angle: f64,
    /// Its greatest depth R: angle from the innermost pixel to the border, radians.
    pub radius: f64,
    /// Unit vector to the innermost point.
    pub centre: [f32; 3],
    /// What the brightness is predicted from. 0: 1. Of the region: 1: ln of the solid angle over that of a disc of radius R
    /// (0 for a disc, more for ragged regions); 2: squared sine of the centre's elevation; 3 and 4: mean ln(blue/red)
    /// of a ring around it, as wide as R, and its square. Of the whole panorama: 5: how much brighter the ground is than
    /// what is seen of the sky makes it; 6: how deep its shadows are; 7: ln of the irradiance of a surface that faces up.
    pub features: [f64; FEATURES],
}

/// The depth in which the expand map has risen to its shoulder, radians; chosen with the fit.
const SHOULDER: f64 = 0.02;

/// Sums over the pixels of one region or of the ring around it.
#[derive(Clone, Copy, Default)]
struct Sums {
    solid_angle: f64,
    deepest: f64,
    centre: [f64; 3],
    ring: f64,
    ring_hue: f64,
}

/// The regions in the order of their labels, and for each pixel x of [`super::Analysis::pixels`] (0 outside).
pub(super) fn describe(
    angles: &Angles,
    linear: &Panorama,
    labels: &[u32],
    count: usize,
    nearest: &[u32],
) -> (Vec<Region>, Vec<f32>) {
    let grid = linear.grid();
    let half = 0.5 * PI / grid.height as f64;
    let weight = |pixel: usize| grid.solid_angle(pixel / grid.width);
    let depth = |pixel: usize| match nearest[pixel] {
        NOWHERE => PI,
        // the border runs between the two pixels
        border => (angles.between(pixel as u32, border) - half).max(half),
    };
    let inside: Vec<(usize, usize, f64)> = (labels.iter().enumerate())
        .filter(|(_, label)| **label != OUTSIDE)
        .map(|(pixel, label)| (pixel, *label as usize, depth(pixel)))
        .collect();
    let mut sums = vec![Sums::default(); count];
    for &(pixel, region, depth) in &inside {
        sums[region].solid_angle += weight(pixel);
        sums[region].deepest = sums[region].deepest.max(depth);
    }
    let mut shape = vec![0.0; labels.len()];
    for &(pixel, region, depth) in &inside {
        let sum = &mut sums[region];
        let radius = sum.deepest + half;
        let left = (1.0 - depth / radius).max(SUN_RADIUS / radius).min(1.0);
        shape[pixel] = (1.0 - (-depth / SHOULDER).exp() - left.ln()) as f32;
        if depth >= sum.deepest - 0.5 * half {
            let direction = grid.direction(pixel % grid.width, pixel / grid.width);
            sum.centre.iter_mut().zip(direction).for_each(|(c, d)| *c += weight(pixel) * f64::from(d));
        }
    }
    add_rings(angles, linear, labels, &mut sums);
    let scene = Scene::new(linear, labels);
    let regions = sums.iter().map(|sum| sum.region(half, scene)).collect();
    (regions, shape)
}

/// Adds to each region what lies around it, up to its own radius away.
fn add_rings(angles: &Angles, linear: &Panorama, labels: &[u32], sums: &mut [Sums]) {
    let grid = linear.grid();
    let outside: Vec<bool> = labels.iter().map(|label| *label == OUTSIDE).collect();
    let nearest = nearest_outside(angles, &outside);
    for (pixel, &region) in nearest.iter().enumerate() {
        if !outside[pixel] || region == NOWHERE {
            continue;
        }
        let sum = &mut sums[labels[region as usize] as usize];
        if angles.between(pixel as u32, region) > sum.deepest.max(RING) {
            continue;
        }
        let [r, _, b] = linear.pixels()[pixel];
        let weight = grid.solid_angle(pixel / grid.width);
        sum.ring += weight;
        sum.ring_hue += weight * f64::from((b + 1e-3) / (r + 1e-3)).ln();
    }
}

impl Sums {
    fn region(&self, half: f64, scene: Scene) -> Region {
        let radius = self.deepest + half;
        let disc = 2.0 * PI * (1.0 - radius.cos());
        let length = length(self.centre).max(f64::MIN_POSITIVE);
        let centre = self.centre.map(|c| (c / length) as f32);
        let hue = self.ring_hue / self.ring.max(f64::MIN_POSITIVE);
        let features = [
            1.0,
            (self.solid_angle / disc).ln(),
            f64::from(centre[2]).powi(2),
            hue,
            hue * hue,
            scene.balance,
            scene.shadows,
            scene.irradiance,
        ];
        Region { solid_angle: self.solid_angle, radius, centre, features }
    }
}
