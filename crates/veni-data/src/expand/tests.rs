//! Expansion of panoramas whose truth is known.

use std::path::Path;

use super::*;
use crate::expand::Expand;
use veni_image::tonemap::{MIDDLE_GREY, srgb};
use veni_image::{Panorama, luminance};
use veni_light::sphere::Equirect;

const GRID: Equirect = Equirect { width: 512, height: 256 };

/// What a camera whose white is radiance 1 records, in 8 bits.
fn record(truth: &Panorama) -> LdrPanorama {
    let code = |v: f32| (srgb(v.clamp(0.0, 1.0)) * 255.0).round() / 255.0;
    LdrPanorama::new(truth.grid(), truth.pixels().iter().map(|p| p.map(code)).collect())
}

/// A blue sky with a sun of radiance 40,000 and its aureole, over ground of albedo 0.2 that lies in their light or in shade.
fn sunny(sun: [f32; 3]) -> Panorama {
    Panorama::from_fn(GRID, |d| {
        let cosine: f32 = d.iter().zip(sun).map(|(a, b)| a * b).sum();
        let angle = cosine.clamp(-1.0, 1.0).acos();
        let aureole = 0.5 * (0.12 / angle.max(0.006)).powf(1.8);
        let disc = if angle < 0.006 { 4e4 } else { 0.0 };
        if d[2] > 0.0 {
            return [0.25, 0.4, 0.7].map(|s| s + aureole + disc);
        }
        let direct = 4e4 * std::f32::consts::PI * 0.006f32.powi(2) * sun[2];
        let lit = if (20.0 * d[1].atan2(d[0])).sin() > 0.0 { direct } else { 0.0 };
        [0.23, 0.2, 0.16].map(|albedo| albedo / std::f32::consts::PI * (1.3 + lit))
    })
}

fn unit([x, y, z]: [f32; 3]) -> [f32; 3] {
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

fn energy(panorama: &Panorama) -> f64 {
    let grid = panorama.grid();
    let weighted = |(k, p): (usize, &[f32; 3])| f64::from(luminance(*p)) * grid.solid_angle(k / grid.width);
    panorama.pixels().iter().enumerate().map(weighted).sum()
}

#[test]
fn nothing_clipped_is_nothing_changed() {
    let truth = Panorama::from_fn(GRID, |[x, y, z]| [0.4 + 0.3 * x, 0.4 + 0.3 * y, 0.4 + 0.3 * z]);
    let ldr = record(&truth);
    let expanded = ldr.expand(&ExpandOptions::default());
    assert_eq!(expanded.panorama, ldr.linear(TransferFunction::Srgb));
    assert_eq!((expanded.clipped, expanded.regions, expanded.sun), (0.0, 0, None));
    for (a, b) in truth.pixels().iter().flatten().zip(expanded.panorama.pixels().iter().flatten()) {
        assert!((a - b).abs() < 5e-3, "{a} became {b}: 8 bits of sRGB");
    }
    let gamma = ldr.linear(TransferFunction::Gamma(2.0)).pixels()[0][0];
    assert!((gamma - ldr.values()[0][0].powi(2)).abs() < 1e-6);
}

#[test]
fn the_sun_comes_back_where_it_was() {
    for at in [[0.5, -0.3, 0.6], [-1.0, 0.0, 0.4], [0.01, 0.02, 1.0]].map(unit) {
        let truth = sunny(at);
        let ldr = record(&truth);
        let expanded = ldr.expand(&ExpandOptions::default());
        let sun = expanded.sun.expect("a sun");
        let cosine: f32 = sun.direction.iter().zip(at).map(|(a, b)| a * b).sum();
        assert!(cosine > 0.9995, "{:?} for {at:?}", sun.direction);
        let [all, linear, rebuilt] =
            [&truth, &ldr.linear(TransferFunction::Srgb), &expanded.panorama].map(energy);
        assert!(
            (rebuilt / all).ln().abs() < 0.9 * (linear / all).ln().abs(),
            "{linear} → {rebuilt} of {all}"
        );
        assert!(expanded.panorama.pixels().iter().flatten().all(|v| v.is_finite()));
        let below = ldr
            .linear(TransferFunction::Srgb)
            .pixels()
            .iter()
            .flatten()
            .zip(expanded.panorama.pixels().iter().flatten())
            .filter(|(l, e)| **e < **l - 0.05)
            .count();
        assert_eq!(below, 0, "nothing gets darker");
    }
}

#[test]
fn a_rotated_panorama_expands_to_the_rotated_expansion() {
    let ldr = record(&sunny(unit([0.5, -0.3, 0.6])));
    let columns = 300;
    let mut values = ldr.values().to_vec();
    values.chunks_exact_mut(GRID.width).for_each(|row| row.rotate_left(columns));
    let rotated = LdrPanorama::new(GRID, values).expand(&ExpandOptions::default()).panorama;
    let mut expected = ldr.expand(&ExpandOptions::default()).panorama;
    expected.pixels_mut().chunks_exact_mut(GRID.width).for_each(|row| row.rotate_left(columns));
    // the disc's few sample points may fall into a neighbouring pixel by rounding
    let off =
        rotated.pixels().iter().zip(expected.pixels()).filter(|(a, b)| (a[1] - b[1]).abs() > 1e-3 * b[1]);
    assert!(off.count() <= 4);
    assert!((energy(&rotated) / energy(&expected) - 1.0).abs() < 1e-4);
}

#[test]
fn a_clipped_channel_takes_the_hue_around_it() {
    // a sky of one hue whose blue runs over white in the middle
    let truth = Panorama::from_fn(GRID, |[x, _, z]| {
        let level = 0.35 + 0.3 * (x.max(0.0) * (1.0 - z * z)).powi(4);
        [0.8 * level, 1.2 * level, 2.0 * level]
    });
    let ldr = record(&truth);
    let (linear, expanded) = (ldr.linear(TransferFunction::Srgb), ldr.expand(&ExpandOptions::default()));
    assert!(expanded.clipped > 0.005 && expanded.regions == 0, "{} {}", expanded.clipped, expanded.regions);
    let worst = |image: &Panorama| {
        let error = |(a, b): (&[f32; 3], &[f32; 3])| (a[2] / b[2] - 1.0).abs();
        image.pixels().iter().zip(truth.pixels()).map(error).fold(0f32, f32::max)
    };
    assert!(worst(&linear) > 0.2 && worst(&expanded.panorama) < 0.04, "{}", worst(&expanded.panorama));
}

#[test]
fn white_throughout_and_single_pixels_are_no_trouble() {
    let white = LdrPanorama::new(Equirect::new(16, 8), vec![[1.0; 3]; 128]).expand(&ExpandOptions::default());
    assert!(white.panorama.pixels().iter().flatten().all(|v| v.is_finite() && *v >= 1.0));
    for at in [0, 17, 127] {
        let mut values = vec![[0.3; 3]; 128];
        values[at] = [1.0; 3];
        let one = LdrPanorama::new(Equirect::new(16, 8), values).expand(&ExpandOptions::default());
        assert!(one.regions == 1 && one.panorama.pixels().iter().flatten().all(|v| v.is_finite()));
    }
}

/// The fitted numbers on real panoramas that they were not fitted to.
#[test]
fn expanded_is_nearer_to_the_truth_than_linearised() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/panoramas/val");
    let (mut linear, mut expanded) = ([0f64; 2], [0f64; 2]);
    for file in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
        let mut truth = Panorama::read(&file).unwrap();
        truth.sanitise().unwrap();
        truth.scale(2.0 * MIDDLE_GREY / truth.mean_log_luminance().exp());
        let ldr = record(&truth);
        for (image, sums) in [
            (ldr.linear(TransferFunction::Srgb), &mut linear),
            (ldr.expand(&ExpandOptions::default()).panorama, &mut expanded),
        ] {
            let clipped = truth
                .pixels()
                .iter()
                .zip(image.pixels())
                .enumerate()
                .filter(|(_, (t, _))| t.iter().any(|v| *v > 1.0));
            let (mut square, mut weight) = (0.0, 0.0);
            for (k, (t, i)) in clipped {
                let solid = truth.grid().solid_angle(k / truth.grid().width);
                square += solid * f64::from((luminance(*i) / luminance(*t)).ln().powi(2));
                weight += solid;
            }
            // one of them has nothing above white
            sums[0] += (square / f64::max(weight, 1e-9)).sqrt();
            sums[1] += (energy(&image) / energy(&truth)).ln().abs();
        }
    }
    assert!(expanded[0] < 0.8 * linear[0], "log error where clipped: {expanded:?} after {linear:?}");
    assert!(expanded[1] < 0.65 * linear[1], "energy: {expanded:?} after {linear:?}");
}
