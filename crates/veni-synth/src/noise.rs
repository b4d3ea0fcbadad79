//! Gradient noise (Perlin 2002) on a hashed lattice and its fractal sums, in two and three dimensions.

use glam::{Vec2, Vec3};

/// A well-mixed hash of a lattice point ("lowbias32", C. Wellons 2018).
fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77).rotate_left(11)
        ^ (z as u32).wrapping_mul(0xc2b2_ae3d).rotate_left(21)
        ^ seed;
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// A uniform number in [0, 1) for a cell.
pub(super) fn cell(x: i32, y: i32, seed: u32) -> f32 {
    (hash(x, y, 77, seed) >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
}

fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}

/// Gradients towards the middles of the edges of a cube, four of them twice so that there are sixteen.
const EDGES: [[f32; 3]; 16] = [
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, -1.0, 1.0],
    [0.0, 1.0, -1.0],
    [0.0, -1.0, -1.0],
    [1.0, 1.0, 0.0],
    [0.0, -1.0, 1.0],
    [-1.0, 1.0, 0.0],
    [0.0, -1.0, -1.0],
];

const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Gradients in eight directions, all of one length.
const COMPASS: [[f32; 2]; 8] = [
    [1.0, 0.0],
    [-1.0, 0.0],
    [0.0, 1.0],
    [0.0, -1.0],
    [HALF, HALF],
    [HALF, -HALF],
    [-HALF, HALF],
    [-HALF, -HALF],
];

/// Cell and place in it. The baseline instruction set has no rounding, and a call would cost more than all the rest.
fn split(x: f32) -> (i32, f32) {
    let cut = x as i32;
    let cell = cut - i32::from(x < cut as f32);
    (cell, x - cell as f32)
}

/// In about −1 to 1, mean 0, deviation about 0.27, one feature per unit.
pub(super) fn noise3(p: Vec3, seed: u32) -> f32 {
    let ((x, a), (y, b), (z, c)) = (split(p.x), split(p.y), split(p.z));
    let (u, v, w) = (fade(a), fade(b), fade(c));
    let corner = |i: i32, j: i32, k: i32| {
        let [gx, gy, gz] = EDGES[(hash(x + i, y + j, z + k, seed) & 15) as usize];
        gx * (a - i as f32) + gy * (b - j as f32) + gz * (c - k as f32)
    };
    let plane = |k: i32| {
        let low = lerp(corner(0, 0, k), corner(1, 0, k), u);
        lerp(low, lerp(corner(0, 1, k), corner(1, 1, k), u), v)
    };
    lerp(plane(0), plane(1), w)
}

/// As [`noise3`], in the plane.
pub(super) fn noise2(p: Vec2, seed: u32) -> f32 {
    let ((x, a), (y, b)) = (split(p.x), split(p.y));
    let (u, v) = (fade(a), fade(b));
    let corner = |i: i32, j: i32| {
        let [gx, gy] = COMPASS[(hash(x + i, y + j, 0, seed) & 7) as usize];
        gx * (a - i as f32) + gy * (b - j as f32)
    };
    lerp(lerp(corner(0, 0), corner(1, 0), u), lerp(corner(0, 1), corner(1, 1), u), v)
}

/// The part of an octave with features of size `wavelength` that survives averaging over `footprint`.
fn survives(wavelength: f32, footprint: f32) -> f32 {
    (2.0 - 2.0 * footprint / wavelength).clamp(0.0, 1.0)
}

/// A fractal sum of octaves, each half as large and `gain` as strong, in about −1 to 1. Octaves finer than
/// `footprint` (in the units of `p`) are left out, so that nothing aliases at a distance.
pub(super) fn fractal2(p: Vec2, octaves: u32, gain: f32, footprint: f32, seed: u32) -> f32 {
    let (mut sum, mut norm, mut strength, mut scale) = (0.0, 0.0, 1.0, 1.0);
    for k in 0..octaves {
        let part = survives(2.0 / scale, footprint);
        if part > 0.0 {
            sum += part * strength * noise2(p * scale + 17.3 * k as f32, seed.wrapping_add(k));
        }
        norm += strength * strength;
        strength *= gain;
        scale *= 2.03;
    }
    1.6 * sum / f32::sqrt(norm)
}

/// As [`fractal2`], in space.
pub(super) fn fractal3(p: Vec3, octaves: u32, gain: f32, seed: u32) -> f32 {
    let (mut sum, mut norm, mut strength, mut scale) = (0.0, 0.0, 1.0, 1.0);
    for k in 0..octaves {
        sum += strength * noise3(p * scale + 17.3 * k as f32, seed.wrapping_add(k));
        norm += strength * strength;
        strength *= gain;
        scale *= 2.03;
    }
    1.6 * sum / f32::sqrt(norm)
}

/// Rounded lumps with creases between them, as cauliflower clouds and crowns of trees have, in about −1 to 1.
pub(super) fn billows3(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut norm, mut strength, mut scale) = (0.0, 0.0, 1.0, 1.0);
    for k in 0..octaves {
        let n = noise3(p * scale + 17.3 * k as f32, seed.wrapping_add(k)).abs();
        sum += strength * (2.6 * n - 0.6);
        norm += strength;
        strength *= 0.5;
        scale *= 2.1;
    }
    sum / norm
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_centred_bounded_and_vanishes_below_the_footprint() {
        let (mut mean, mut square, mut filtered) = (0.0, 0.0, 0.0);
        for k in 0..4000 {
            let p = Vec2::new(0.37 * k as f32, 0.11 * (k * k % 997) as f32);
            let v = fractal2(p, 4, 0.5, 0.0, 5);
            assert!(v.abs() < 1.8 && fractal3(p.extend(0.3), 4, 0.5, 5).abs() < 1.8);
            (mean, square) = (mean + v / 4000.0, square + v * v / 4000.0);
            filtered += fractal2(p, 4, 0.5, 8.0, 5).abs();
        }
        assert!(mean.abs() < 0.05 && (0.03..0.5).contains(&square), "{mean} {square}");
        assert_eq!(filtered, 0.0);
    }
}
