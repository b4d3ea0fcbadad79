//! LIGHT 3.4 (9), (10): that draws follow the density, and that they save samples.

use super::*;
use crate::light::CompactLight;
use crate::random::Stream;

const PIXELS: [usize; 2] = [96, 48];

/// A sky with a small sun, a dark quarter and a black pixel.
fn sky(grid: Equirect) -> Vec<[f32; 3]> {
    let mut pixels: Vec<[f32; 3]> = (grid.directions().into_iter())
        .map(|[x, y, z]| {
            let sun = if 0.48 * x - 0.6 * y + 0.64 * z > 0.9985 { 900.0 } else { 0.0 };
            [0.4 + 0.3 * z + sun, 0.5 + 0.3 * z + sun, 0.8 + 0.4 * z + 0.9 * sun]
                .map(|v: f32| if z < 0.0 { 0.1 * v } else { v })
        })
        .collect();
    pixels[700] = [0.0; 3];
    pixels
}

fn grid() -> Equirect {
    Equirect::new(PIXELS[0], PIXELS[1])
}

fn numbers(seed: u64) -> impl FnMut() -> [f32; 2] {
    let mut stream = Stream::from_seed(seed);
    move || [0, 1].map(|_| (stream.next_u32() >> 8) as f32 / (1 << 24) as f32)
}

#[test]
fn draws_follow_the_density() {
    let pixels = sky(grid());
    let map = EnvironmentMap::new(grid(), &pixels).unwrap();
    let plain = Sampler::new(map);
    for sampler in [plain.clone(), plain.compensated(), plain.rotated(1.0)] {
        for seed in 0..5 {
            let (draws, cells) = (400_000, 24 * 12);
            let mut next = numbers(seed);
            let coarse = Equirect::new(24, 12);
            let mut seen = vec![0f64; cells];
            for _ in 0..draws {
                let [x, y] = coarse.pixel(sampler.sample(next()).direction);
                seen[(y as usize).min(11) * 24 + (x as usize).min(23)] += 1.0;
            }
            // what each cell should have: its density by fine sums
            let fine = Equirect::new(24 * 32, 12 * 32);
            let mut expected = vec![0f64; cells];
            for (k, d) in fine.directions().into_iter().enumerate() {
                let (column, row) = (k % fine.width, k / fine.width);
                expected[row / 32 * 24 + column / 32] +=
                    fine.solid_angle(row) * f64::from(sampler.pdf(d)) * draws as f64;
            }
            let whole: f64 = expected.iter().sum::<f64>() / draws as f64;
            assert!((whole - 1.0).abs() < 2e-2, "density holds {whole}");
            let mut square = 0.0;
            let mut free = 0.0;
            for (seen, expected) in seen.iter().zip(&expected) {
                if *expected >= 5.0 {
                    // the fine sums know the edges of the sun's pixels to a few percent of a cell only
                    let spread = expected + (0.01 * expected).powi(2);
                    square += (seen - expected).powi(2) / spread;
                    free += 1.0;
                }
            }
            // Wilson and Hilferty: within 4.3 standard deviations, p > 1e-5 for fifteen tests
            let z = ((square / free).cbrt() - (1.0 - 2.0 / (9.0 * free))) / (2.0f64 / (9.0 * free)).sqrt();
            assert!(z < 4.3, "seed {seed}: χ² of {square} for {free} cells");
        }
    }
}

/// Per pixel and exactly: that many draws on a regular net fall into each pixel as its weight says.
#[test]
fn every_pixel_gets_its_share() {
    let pixels = sky(grid());
    let map = EnvironmentMap::new(grid(), &pixels).unwrap();
    let sampler = Sampler::new(map);
    let (n, m) = (8192, 512);
    let mut seen = vec![0u32; grid().len()];
    for i in 0..n {
        for j in 0..m {
            seen[sampler.pixel([i as f32 / n as f32, (j as f32 + 0.5) / m as f32]).0] += 1;
        }
    }
    for (k, seen) in seen.into_iter().enumerate() {
        let expected =
            grid().solid_angle(k / PIXELS[0]) * f64::from(sampler.density(pixels[k])) * f64::from(n * m);
        assert!(
            (f64::from(seen) - expected).abs() < 0.01 * expected + 2.0 * 8192.0 / 512.0,
            "{k}: {seen} for {expected}"
        );
    }
}

#[test]
fn densities_integrate_to_one_and_agree() {
    let pixels = sky(grid());
    let map = EnvironmentMap::new(grid(), &pixels).unwrap();
    let plain = Sampler::new(map);
    for sampler in [plain.clone(), plain.compensated()] {
        let whole: f64 = (0..grid().len())
            .map(|k| grid().solid_angle(k / PIXELS[0]) * f64::from(sampler.density(pixels[k])))
            .sum();
        assert!((whole - 1.0).abs() < 1e-6, "{whole}");
        for sampler in [sampler.clone(), sampler.rotated(-2.0)] {
            let mut next = numbers(9);
            for _ in 0..20_000 {
                let u = next();
                let sample = sampler.sample(u);
                let length: f32 = sample.direction.iter().map(|v| v * v).sum();
                assert!((length - 1.0).abs() < 1e-5);
                assert!((sampler.pdf(sample.direction) / sample.pdf - 1.0).abs() < 1e-6, "{u:?}: {sample:?}");
                assert!(sample.pdf > 0.0 && sample.radiance != [0.0; 3], "a black pixel was drawn");
                assert_eq!(sampler.pixel(u), sampler.clone().pixel(u));
            }
        }
    }
    // a wrong pixel is noticed: a density rotated against its samples
    let (sampler, other) = (plain.clone(), plain.rotated(0.2));
    let mut next = numbers(9);
    let misses = (0..1000).filter(|_| {
        let sample = sampler.sample(next());
        (other.pdf(sample.direction) / sample.pdf - 1.0).abs() > 1e-6
    });
    assert!(misses.count() > 300);
}

#[test]
fn a_rotation_rotates_samples() {
    let pixels = sky(grid());
    let sampler = Sampler::new(EnvironmentMap::new(grid(), &pixels).unwrap());
    let rotated = sampler.rotated(0.7);
    let mut next = numbers(3);
    for _ in 0..1000 {
        let u = next();
        let ([x, y, z], b) = (sampler.sample(u).direction, rotated.sample(u));
        let (s, c) = 0.7f32.sin_cos();
        for (p, q) in [c * x - s * y, s * x + c * y, z].into_iter().zip(b.direction) {
            assert!((p - q).abs() < 1e-6);
        }
    }
}

#[test]
fn odd_maps_have_an_answer() {
    fn evenly(pixels: &[[f32; 3]]) -> Sampler<'_> {
        Sampler::new(EnvironmentMap::new(grid(), pixels).unwrap())
    }
    // black: even
    let black = vec![[0.0; 3]; grid().len()];
    assert!((evenly(&black).pdf([0.6, 0.0, 0.8]) - 0.25 / PI).abs() < 1e-7);
    assert!((evenly(&black).sample([0.2, 0.9]).pdf - 0.25 / PI).abs() < 1e-7);
    // constant, and nothing above the mean (or rounding): still a density
    let constant = vec![[2.0; 3]; grid().len()];
    let compensated = evenly(&constant).compensated();
    assert!(compensated.sample([0.5, 0.5]).pdf > 0.0);
    // maps of one or two rows: as even as others
    for grid in [Equirect::new(2, 1), Equirect::new(4, 2)] {
        let pixels = vec![[1.0; 3]; grid.len()];
        let sampler = Sampler::new(EnvironmentMap::new(grid, &pixels).unwrap());
        let (mut next, mut sum, mut square) = (numbers(6), 0.0, 0.0);
        for _ in 0..40_000 {
            let [_, _, z] = sampler.sample(next()).direction;
            (sum, square) = (sum + z / 40_000.0, square + z * z / 40_000.0);
        }
        assert!(sum.abs() < 0.01 && (square - 1.0 / 3.0).abs() < 0.01, "{grid:?}: {sum} {square}");
    }
    // one pixel: always that
    let mut one = black;
    one[1234] = [5.0; 3];
    let mut next = numbers(4);
    for _ in 0..1000 {
        assert_eq!(evenly(&one).pixel(next()).0, 1234);
    }
}

/// Relative variance of one sample of irradiance, geometric mean over normals: even, by luminance, with a cosine by the balance
/// heuristic, the same compensated, and as two lights.
#[test]
fn samples_are_saved() {
    let grid = Equirect::new(256, 128);
    let sun = CompactLight::new([0.48, -0.6, 0.64], [3.0; 3], 0.02);
    let rest: Vec<[f32; 3]> = sky(grid).into_iter().map(|p| p.map(|v| v.min(2.0))).collect();
    let mut whole = rest.clone();
    let level = sun.radiance()[0];
    for (pixel, d) in whole.iter_mut().zip(grid.directions()) {
        if d.iter().zip(sun.direction).map(|(a, b)| a * b).sum::<f32>() > sun.radius.cos() {
            *pixel = pixel.map(|v| v + level);
        }
    }
    let plain = Sampler::new(EnvironmentMap::new(grid, &whole).unwrap());
    let compensated = plain.compensated();
    let mut logs = [0f64; 3];
    let normals = [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, -0.8, 0.6], [0.48, -0.6, 0.64], [0.0, -0.6, -0.8]];
    for normal in normals {
        // exact sums over pixels: E, and the second moments
        let (mut e, mut even, mut one, mut two) = (0.0, 0.0, 0.0, 0.0);
        for (k, d) in grid.directions().into_iter().enumerate() {
            let w = grid.solid_angle(k / grid.width);
            let cosine = f64::from(d.iter().zip(normal).map(|(a, b)| a * b).sum::<f32>()).max(0.0);
            let f = f64::from(luminance(whole[k])) * cosine;
            e += w * f;
            even += w * f * f * 4.0 * std::f64::consts::PI;
            let surface = cosine / std::f64::consts::PI;
            // one sample from either, half of the time each: variance of the balance heuristic
            let mixed = |pdf: f64| if f > 0.0 { f * f / (0.5 * (pdf + surface)) } else { 0.0 };
            one += w * mixed(f64::from(plain.density(whole[k])));
            two += w * mixed(f64::from(compensated.density(whole[k])));
        }
        for (log, moment) in logs.iter_mut().zip([even, one, two]) {
            *log += ((moment - e * e) / (e * e)).ln() / normals.len() as f64;
        }
    }
    let [even, one, two] = logs.map(f64::exp);
    assert!(two < 0.9 * one, "compensated {two}, plain {one}");
    assert!(two < even / 30.0, "compensated {two}, even {even}");
}

#[test]
fn two_lights_are_one_sky() {
    let pixels: Vec<[f32; 3]> = sky(grid()).into_iter().map(|p| p.map(|v| v.min(2.0))).collect();
    let map = EnvironmentMap::new(grid(), &pixels).unwrap();
    let sun = CompactLight::new([0.48, -0.6, 0.64], [3.0, 2.5, 2.0], CompactLight::SUN_RADIUS);
    let sampler = SplitSampler::new(sun, Sampler::new(map));
    assert!(sampler.share() > 0.1 && sampler.share() < 0.9);
    let (mut next, draws) = (numbers(5), 400_000);
    let (mut irradiance, mut suns) = ([0f64; 3], 0);
    for _ in 0..draws {
        let sample = sampler.sample(next());
        assert!((sampler.pdf(sample.direction) / sample.pdf - 1.0).abs() < 1e-3 || sample.pdf > 100.0);
        let cosine = f64::from(sample.direction[2].max(0.0));
        irradiance = [0, 1, 2].map(|c| {
            irradiance[c] + f64::from(sample.radiance[c]) * cosine / f64::from(sample.pdf) / f64::from(draws)
        });
        suns += u32::from(sample.pdf > 100.0);
    }
    assert!((f64::from(suns) / f64::from(draws) - f64::from(sampler.share())).abs() < 0.01);
    for c in 0..3 {
        let rest: f64 = (grid().directions().iter().enumerate())
            .map(|(k, d)| grid().solid_angle(k / PIXELS[0]) * f64::from(d[2].max(0.0) * pixels[k][c]))
            .sum();
        let exact = rest + 0.64 * f64::from(sun.irradiance[c]);
        assert!((irradiance[c] / exact - 1.0).abs() < 0.01, "{} for {exact}", irradiance[c]);
    }
}
