//! Every level against a sum over all pixels.

use super::*;
use crate::sphere::{CubeFace, Equirect};

/// A sun of its true size with the energy of a clear day.
pub(super) fn sun(direction: [f32; 3]) -> CompactLight {
    let length = direction.iter().map(|v| v * v).sum::<f32>().sqrt();
    CompactLight::new(direction.map(|v| v / length), [6.0, 5.0, 4.0], CompactLight::SUN_RADIUS)
}

/// A sky with a gradient, an aureole, a dark ground with a sharp horizon, and blocks of a few degrees: of all scales.
pub(super) fn sky(grid: Equirect, sun: [f32; 3]) -> Vec<[f32; 3]> {
    (grid.directions().into_iter())
        .map(|[x, y, z]| {
            let t = x * sun[0] + y * sun[1] + z * sun[2];
            let glow = 4.0 * (40.0 * (t - 1.0)).exp();
            if z < 0.0 {
                return [0.12, 0.1, 0.08];
            }
            let block = ((9.0 * y.atan2(x)).sin() * (11.0 * z).sin()).signum();
            let house = if z < 0.25 && block > 0.0 { 0.3 } else { 1.0 };
            [0.5 + glow, 0.7 + 0.2 * z + glow, 1.0 + 0.4 * z + 0.9 * glow].map(|v| house * v)
        })
        .collect()
}

/// ∫ L K dω / ∫ K dω by the sum over pixels, each divided into n × n, and the sun as a disc of many points.
fn truth(
    map: EnvironmentMap<'_>,
    lights: &[CompactLight],
    alpha: f64,
    n: usize,
    normal: [f32; 3],
) -> [f64; 3] {
    let k = |t: f64| {
        let d = (1.0 + t) / 2.0 * (alpha * alpha - 1.0) + 1.0;
        if t > 0.0 { t / (d * d) } else { 0.0 }
    };
    let grid = map.grid();
    let fine = Equirect::new(grid.width * n, grid.height * n);
    let dot = |d: [f64; 3]| (0..3).map(|i| d[i] * f64::from(normal[i])).sum::<f64>();
    let (mut sum, mut whole) = ([0.0; 3], 0.0);
    for row in 0..fine.height {
        let (st, ct) = fine.polar(row).sin_cos();
        let w = fine.solid_angle(row);
        for column in 0..fine.width {
            let (sp, cp) = fine.azimuth(column).sin_cos();
            let value = w * k(dot([st * cp, st * sp, ct]));
            whole += value;
            let pixel = map.pixels()[row / n * grid.width + column / n];
            sum = [0, 1, 2].map(|c| sum[c] + value * f64::from(pixel[c]));
        }
    }
    let mut result = sum.map(|s| s / whole);
    // the lobe's own integral, not that of the pixels
    let m = 200_000;
    let exact: f64 = (0..m)
        .map(|i| {
            let polar = std::f64::consts::FRAC_PI_2 * (f64::from(i) + 0.5) / f64::from(m);
            k(polar.cos()) * polar.sin() * std::f64::consts::TAU * std::f64::consts::FRAC_PI_2 / f64::from(m)
        })
        .sum();
    for light in lights {
        let s = light.direction.map(f64::from);
        let u = if s[2].abs() < 0.9 { [-s[1], s[0], 0.0] } else { [0.0, -s[2], s[1]] };
        let length = u.iter().map(|x| x * x).sum::<f64>().sqrt();
        let u = u.map(|x| x / length);
        let v = [s[1] * u[2] - s[2] * u[1], s[2] * u[0] - s[0] * u[2], s[0] * u[1] - s[1] * u[0]];
        let mut mean = 0.0;
        for i in 0..40 {
            let r = f64::from(light.radius) * ((f64::from(i) + 0.5) / 40.0).sqrt();
            for j in 0..40 {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(j) / 40.0).sin_cos();
                mean +=
                    k(dot([0, 1, 2].map(|c| s[c] * r.cos() + r.sin() * (cos * u[c] + sin * v[c])))) / 1600.0;
            }
        }
        result = [0, 1, 2].map(|c| result[c] + f64::from(light.irradiance[c]) * mean / exact);
    }
    result
}

/// Texels to check: spread over the cube, and those around the sun.
fn places(size: usize, axes: CubeAxes, sun: [f32; 3]) -> Vec<usize> {
    let mut places: Vec<usize> = (0..48).map(|k| (k * 7919 + 13) % (6 * size * size)).collect();
    for d in [[0.0, 0.0, 0.0], [0.02, 0.0, 0.01], [-0.03, 0.05, 0.0], [0.0, -0.15, 0.1]] {
        places.push(CubeMap::index(size, axes, [0, 1, 2].map(|c| sun[c] + d[c])));
    }
    places
}

fn direction(size: usize, axes: CubeAxes, index: usize) -> [f32; 3] {
    let (face, k) = (CubeFace::ALL[index / (size * size)], index % (size * size));
    let centre = |i: usize| (2 * i + 1) as f64 / size as f64 - 1.0;
    let v = axes.native(face.lookup(centre(k % size), centre(k / size)).map(|x| x as f32));
    let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
    v.map(|x| x / length)
}

/// Relative RMSE over texels that are spread evenly and around the sun.
fn error(prefilter: &Prefilter<'_>, p: f64, size: usize, sub: usize, sun: [f32; 3]) -> f64 {
    let axes = CubeAxes::BEVY;
    let cube = prefilter.level(p, size, axes);
    let (mut difference, mut square) = (0.0, 0.0);
    for index in places(size, axes, sun) {
        let expected = truth(prefilter.map, &prefilter.lights, p * p, sub, direction(size, axes, index));
        for (found, expected) in cube.texels()[index].into_iter().zip(expected) {
            difference += (f64::from(found) - expected).powi(2);
            square += expected * expected;
        }
    }
    (difference / square).sqrt()
}

/// Where suns stand: anywhere, on the seam, at the zenith, at a cube's edge and corner, near the horizon.
const SUNS: [[f32; 3]; 6] = [
    [0.48, -0.6, 0.64],
    [-0.8, 0.0, 0.6],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.57735, 0.57735, 0.57735],
    [0.0995, -0.995, 0.02],
];

/// LIGHT 3.4 (4): brute force.
#[test]
fn levels_are_the_sum_over_all_pixels() {
    let grid = Equirect::new(256, 128);
    for (k, direction) in SUNS.into_iter().enumerate() {
        let light = sun(direction);
        let pixels = sky(grid, light.direction);
        let map = EnvironmentMap::new(grid, &pixels).unwrap();
        let levels = Levels::down_to(256, 16, Law::Quadratic);
        let prefilter = Prefilter::new(map, &[levels]).with_lights(&[light]);
        for level in [1 + k % 2, 3, 4] {
            let p = levels.roughness(level);
            let error =
                error(&prefilter, p, levels.size(level), if level < 3 { 4 } else { 1 }, light.direction);
            let bar = if p >= 0.29 { 0.003 } else { 0.01 };
            assert!(error < bar, "sun {direction:?}, p = {p}: {error}");
            // a lobe that is half a texel off is noticed
            if k == 0 {
                let mut moved = prefilter.clone();
                let shifted = light.rotated((1.0 / levels.size(level) as f64).max(0.02));
                moved.lights = vec![shifted];
                let cube = moved.level(p, levels.size(level), CubeAxes::BEVY);
                let mut sums = (0.0, 0.0);
                for index in places(levels.size(level), CubeAxes::BEVY, light.direction) {
                    let at = self::direction(levels.size(level), CubeAxes::BEVY, index);
                    let expected = truth(map, &[light], p * p, 1, at);
                    for (found, expected) in cube.texels()[index].into_iter().zip(expected) {
                        sums.0 += (f64::from(found) - expected).powi(2);
                        sums.1 += expected * expected;
                    }
                }
                assert!((sums.0 / sums.1).sqrt() > bar, "p = {p}: a shifted sun passed");
            }
        }
    }
}

/// LIGHT 3.4 (1): white furnace.
#[test]
fn a_white_furnace_is_white_at_every_level() {
    let grid = Equirect::new(64, 32);
    let pixels = vec![[1.0; 3]; grid.len()];
    let map = EnvironmentMap::new(grid, &pixels).unwrap();
    for law in [Law::Linear, Law::Quadratic, Law::Babylon] {
        let levels = Levels::down_to(64, 1, law);
        for cube in Prefilter::new(map, &[levels]).specular(levels, CubeAxes::GLTF, |_| {}) {
            assert!(
                cube.texels().iter().flatten().all(|v| (v - 1.0).abs() < 1e-5),
                "{law:?}, {}",
                cube.size()
            );
        }
    }
}

/// LIGHT 3.4 (3): the mean of every level is that of the input, wherever the sun stands.
#[test]
fn energy_is_that_of_the_input() {
    let grid = Equirect::new(256, 128);
    for direction in SUNS {
        let light = sun(direction);
        let pixels = sky(grid, light.direction);
        let map = EnvironmentMap::new(grid, &pixels).unwrap();
        let whole: [f64; 3] = std::array::from_fn(|c| map.integral()[c] + f64::from(light.irradiance[c]));
        for (size, last, law) in [(256, 16, Law::Quadratic), (128, 1, Law::Linear), (64, 1, Law::Babylon)] {
            let levels = Levels::down_to(size, last, law);
            let prefilter = Prefilter::new(map, &[levels]).with_lights(&[light]);
            for (k, cube) in prefilter.specular(levels, CubeAxes::THREE, |_| {}).iter().enumerate() {
                for (a, b) in cube.integral().into_iter().zip(whole) {
                    assert!((a / b - 1.0).abs() < 1e-5, "{direction:?} {law:?} level {k}: {}", a / b);
                }
            }
        }
    }
}

/// LIGHT 3.4 (7): a rotated map and a rotated spectrum give the same levels.
#[test]
fn a_rotation_commutes_with_the_filter() {
    let grid = Equirect::new(128, 64);
    let light = sun([0.48, -0.6, 0.64]);
    let pixels = sky(grid, light.direction);
    let rotated: Vec<[f32; 3]> =
        (0..grid.len()).map(|k| pixels[k / 128 * 128 + (k % 128 + 32) % 128]).collect();
    let levels = Levels::down_to(32, 8, Law::Quadratic);
    let bake = |pixels: &[[f32; 3]], light| {
        let map = EnvironmentMap::new(grid, pixels).unwrap();
        Prefilter::new(map, &[levels]).with_lights(&[light]).level(0.5, 16, CubeAxes::NATIVE)
    };
    let (a, b) = (bake(&rotated, light.rotated(std::f64::consts::FRAC_PI_2)), bake(&pixels, light));
    for (k, texel) in a.texels().iter().enumerate() {
        // seen after a rotation back by 90°
        let [x, y, z] = direction(16, CubeAxes::NATIVE, k);
        let before = b.texels()[CubeMap::index(16, CubeAxes::NATIVE, [y, -x, z])];
        for (p, q) in texel.iter().zip(before) {
            assert!((p - q).abs() < 1e-5 * q.max(1.0), "{p} and {q}");
        }
    }
}

/// The scale that makes energy exact is a correction, not a remedy.
#[test]
fn energy_is_nearly_right_before_it_is_exact() {
    let grid = Equirect::new(256, 128);
    for direction in SUNS {
        let light = sun(direction);
        let pixels = sky(grid, light.direction);
        let map = EnvironmentMap::new(grid, &pixels).unwrap();
        let levels = Levels::down_to(128, 8, Law::Quadratic);
        let prefilter = Prefilter::new(map, &[levels]).with_lights(&[light]);
        for level in 1..levels.count() {
            let (alpha, size) = (levels.roughness(level).powi(2), levels.size(level));
            let glint = Glint::new(&light, alpha);
            let raw = CubeMap::of(size, CubeAxes::BEVY, 1, |d| glint.at(d));
            let factor = raw.integral()[0] / f64::from(light.irradiance[0]);
            assert!((factor - 1.0).abs() < 0.01, "{direction:?}, {size}: {factor}");
            let whole = prefilter.level(levels.roughness(level), size, CubeAxes::BEVY).integral()[0];
            assert!((whole / prefilter.integral()[0] - 1.0).abs() < 1e-5);
        }
    }
}
