//! Irradiance by nine harmonics, with and without lights of their own, against the sum over all pixels.

use veni_light::Result;
use veni_light::light::{EnvironmentMap, Light, Sh};
use veni_light::sphere::Equirect;

use super::panorama;

/// Normals: the pixel centres of this grid, by solid angle.
const NORMALS: Equirect = Equirect { width: 16, height: 8 };

pub(crate) fn run(files: &[&str]) -> Result<()> {
    let mut columns: [Vec<f64>; 4] = Default::default();
    println!("| panorama | lights | nine harmonics | sun + nine | all lights + nine | lights + cells |");
    println!("|---|---|---|---|---|---|");
    for file in files {
        let panorama = panorama(file)?;
        let map = panorama.environment()?;
        let directions = map.grid().directions();
        let truth = |n: [f32; 3]| exact(map, &directions, n);
        let whole = Sh::<2>::of(map).irradiance();
        let light = Light::of(map);
        let rest = light.residual_sh().irradiance();
        // the sun alone: what is not the sun goes back into the harmonics
        let mut with_lamps = light.residual_sh().clone();
        for lamp in light.lights().iter().skip(usize::from(light.sun().is_some())) {
            with_lamps = with_lamps.plus(&Sh::of_light(lamp));
        }
        let with_lamps = with_lamps.irradiance();
        let sum = |base: [f64; 3], lights: &[veni_light::light::CompactLight], n: [f32; 3]| {
            lights.iter().fold(base, |sum, l| {
                let on = l.irradiance_on(n);
                [0, 1, 2].map(|c| sum[c] + f64::from(on[c]))
            })
        };
        let suns = &light.lights()[..usize::from(light.sun().is_some())];
        let errors = [
            error(&truth, &|n| whole.value(n)),
            error(&truth, &|n| sum(with_lamps.value(n), suns, n)),
            error(&truth, &|n| sum(rest.value(n), light.lights(), n)),
            error(&truth, &|n| light.irradiance(n).map(f64::from)),
        ];
        let name = file.rsplit('/').next().unwrap_or(file).trim_end_matches(".exr");
        println!(
            "| {name} | {}{} | {:.2} % | {:.2} % | {:.2} % | {:.3} % |",
            light.lights().len(),
            if light.sun().is_some() { ", sun" } else { "" },
            100.0 * errors[0],
            100.0 * errors[1],
            100.0 * errors[2],
            100.0 * errors[3],
        );
        columns.iter_mut().zip(errors).for_each(|(column, error)| column.push(error));
    }
    let stat = |column: &mut Vec<f64>| {
        column.sort_by(f64::total_cmp);
        format!("{:.2} / {:.2} %", 100.0 * column[column.len() / 2], 100.0 * column[column.len() - 1])
    };
    let stats: Vec<_> = columns.iter_mut().map(stat).collect();
    println!("| **median / worst** | | {} |", stats.join(" | "));
    Ok(())
}

/// Root mean square error over all normals and channels, over the mean irradiance.
fn error(truth: &dyn Fn([f32; 3]) -> [f64; 3], found: &dyn Fn([f32; 3]) -> [f64; 3]) -> f64 {
    let (mut square, mut mean, mut weights) = (0.0, 0.0, 0.0);
    for (k, n) in NORMALS.directions().into_iter().enumerate() {
        let weight = NORMALS.solid_angle(k / NORMALS.width);
        let (a, b) = (truth(n), found(n));
        for c in 0..3 {
            square += weight * (a[c] - b[c]).powi(2);
            mean += weight * a[c];
            weights += weight;
        }
    }
    (square / weights).sqrt() / (mean / weights)
}

/// Σ ω L max(0, n·d) over every pixel.
pub(crate) fn exact(map: EnvironmentMap<'_>, directions: &[[f32; 3]], normal: [f32; 3]) -> [f64; 3] {
    let grid = map.grid();
    let mut sum = [0.0; 3];
    for row in 0..grid.height {
        let solid_angle = grid.solid_angle(row);
        for column in 0..grid.width {
            let direction = directions[row * grid.width + column];
            let cosine: f32 = direction.iter().zip(normal).map(|(a, b)| a * b).sum();
            if cosine > 0.0 {
                let pixel = map.pixels()[row * grid.width + column];
                sum = [0, 1, 2].map(|c| sum[c] + solid_angle * f64::from(cosine) * f64::from(pixel[c]));
            }
        }
    }
    sum
}
