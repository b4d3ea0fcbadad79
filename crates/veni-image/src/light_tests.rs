//! Compact lights and nine harmonics on photographs: what they are worth for irradiance, and that no energy is lost.

use std::path::Path;

use crate::Panorama;
use veni_light::light::{EnvironmentMap, Light, Sh};
use veni_light::sphere::Equirect;

/// Normals: the pixel centres of this grid.
const NORMALS: Equirect = Equirect { width: 16, height: 8 };

fn photographs() -> Vec<(String, Panorama)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/panoramas");
    let mut files: Vec<_> = ["train", "val"]
        .iter()
        .flat_map(|part| std::fs::read_dir(folder.join(part)).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "exr"))
        .collect();
    files.sort();
    let read = |path: &Path| {
        let mut panorama = Panorama::read(path).unwrap();
        panorama.sanitise().unwrap();
        (path.file_stem().unwrap().to_string_lossy().into_owned(), panorama)
    };
    files.iter().map(|path| read(path)).collect()
}

/// Σ ω L max(0, n·d) over every pixel.
fn exact(map: EnvironmentMap<'_>, normal: [f32; 3]) -> [f64; 3] {
    let grid = map.grid();
    let mut sum = [0.0; 3];
    for (k, (pixel, d)) in map.pixels().iter().zip(grid.directions()).enumerate() {
        let cosine: f32 = d.iter().zip(normal).map(|(a, b)| a * b).sum();
        let weight = grid.solid_angle(k / grid.width) * f64::from(cosine.max(0.0));
        sum = [0, 1, 2].map(|c| sum[c] + weight * f64::from(pixel[c]));
    }
    sum
}

/// Root mean square error over the normals and channels, over the mean irradiance.
fn error(map: EnvironmentMap<'_>, found: impl Fn([f32; 3]) -> [f64; 3]) -> f64 {
    let (mut square, mut mean, mut weights) = (0.0, 0.0, 0.0);
    for (k, n) in NORMALS.directions().into_iter().enumerate() {
        let weight = NORMALS.solid_angle(k / NORMALS.width);
        for (a, b) in exact(map, n).into_iter().zip(found(n)) {
            square += weight * (a - b).powi(2);
            mean += weight * a;
            weights += weight;
        }
    }
    (square / weights).sqrt() * weights / mean
}

#[test]
fn lights_and_nine_harmonics_are_the_irradiance_of_photographs() {
    let (mut plain, mut split) = (Vec::new(), Vec::new());
    for (name, panorama) in photographs() {
        let map = panorama.environment().unwrap();
        let whole = Sh::<2>::of(map).irradiance();
        let light = Light::of(map);
        let rest = light.residual_sh().irradiance();
        let with_lights = |n: [f32; 3]| {
            light.lights().iter().fold(rest.value(n), |sum, l| {
                let on = l.irradiance_on(n);
                [0, 1, 2].map(|c| sum[c] + f64::from(on[c]))
            })
        };
        plain.push(error(map, |n| whole.value(n)));
        split.push(error(map, with_lights));
        let cells = error(map, |n| light.irradiance(n).map(f64::from));
        assert!(cells < 0.05, "{name}: the lights and the residual err by {cells}");
        let left = light.residual().integral();
        for (c, total) in map.integral().into_iter().enumerate() {
            let lights: f64 = light.lights().iter().map(|l| f64::from(l.irradiance[c])).sum();
            assert!(((left[c] + lights) / total - 1.0).abs() < 1e-6, "{name}: energy");
        }
        assert!(light.residual().pixels().iter().flatten().all(|v| *v >= 0.0));
    }
    assert_eq!(split.len(), 16);
    for column in [&mut plain, &mut split] {
        column.sort_by(f64::total_cmp);
    }
    let (median, worst) = (split[8], split[15]);
    // the worst by night: at 128 columns a lamp's three pixels are 8°, and others lie within
    assert!(median < 0.01 && worst < 0.035, "median {median}, worst {worst}: {split:?}");
    // and it is the lights that do it
    assert!(plain[8] > 1.5 * median && plain[15] > 0.05, "{plain:?}");
}
