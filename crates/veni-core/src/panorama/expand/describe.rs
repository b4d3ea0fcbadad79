//! What is known about a clipped region, and can tell how bright it was.

use std::f64::consts::PI;

use super::SUN_RADIUS;
use super::nearest::{Angles, NOWHERE, nearest_outside};
use super::regions::OUTSIDE;
use crate::panorama::{LOG_FLOOR, Panorama, luminance};

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
    /// What the brightness is predicted from: 1; ln of the solid angle; sine of the centre's elevation; ln of the
    /// solid angle over that of a disc of radius R (0 for a disc, more for ragged regions); mean ln luminance of
    /// the panorama; mean ln luminance of a ring around the region, as wide as R; ln of its share of all that is
    /// clipped; mean ln(blue/red) of the ring.
    pub features: [f64; FEATURES],
}

/// Sums over the pixels of one region or of the ring around it.
#[derive(Clone, Copy, Default)]
struct Sums {
    solid_angle: f64,
    deepest: f64,
    centre: [f64; 3],
    ring: f64,
    ring_log: f64,
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
        shape[pixel] = -(1.0 - depth / radius).max(SUN_RADIUS / radius).min(1.0).ln() as f32;
        if depth >= sum.deepest - 0.5 * half {
            let direction = grid.direction(pixel % grid.width, pixel / grid.width);
            sum.centre.iter_mut().zip(direction).for_each(|(c, d)| *c += weight(pixel) * f64::from(d));
        }
    }
    add_rings(angles, linear, labels, &mut sums);
    let total: f64 = sums.iter().map(|s| s.solid_angle).sum();
    let key = f64::from(linear.mean_log_luminance());
    let regions = sums.iter().map(|sum| sum.region(half, total, key)).collect();
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
        let [r, g, b] = linear.pixels()[pixel];
        let weight = grid.solid_angle(pixel / grid.width);
        sum.ring += weight;
        sum.ring_log += weight * f64::from(luminance([r, g, b]).max(LOG_FLOOR)).ln();
        sum.ring_hue += weight * f64::from((b + 1e-3) / (r + 1e-3)).ln();
    }
}

impl Sums {
    fn region(&self, half: f64, total: f64, key: f64) -> Region {
        let radius = self.deepest + half;
        let disc = 2.0 * PI * (1.0 - radius.cos());
        let length = self.centre.iter().map(|c| c * c).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        let centre = self.centre.map(|c| (c / length) as f32);
        let ring = self.ring.max(f64::MIN_POSITIVE);
        let features = [
            1.0,
            self.solid_angle.ln(),
            f64::from(centre[2]),
            (self.solid_angle / disc).ln(),
            key,
            self.ring_log / ring,
            (self.solid_angle / total).ln(),
            self.ring_hue / ring,
        ];
        Region { solid_angle: self.solid_angle, radius, centre, features }
    }
}
