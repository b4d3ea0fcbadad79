//! Where the light comes from: what decides on which side shadows fall.

use crate::exposure::log_luminance;
use veni_light::sphere::Equirect;
use veni_light::vector::{angle, dot, length, scaled};

/// A sun is seen where the largest luminance is e⁶ = 400 times the geometric mean over the sphere, or more. Few panoramas are near
/// that: among photographs at 128 × 64 the lower quartile is e⁴, the median e⁸.
const VISIBLE: f64 = 6.0;

/// What lies within this angle of the brightest pixel counts to it: the sun and its glow.
const GLOW: f32 = 10.0;

/// The angle in degrees between the brightest lights of two images of log radiance. None if the target shows no sun: where its
/// largest luminance is less than 400 times its geometric mean, there is no direction to miss.
///
/// # Panics
/// If a length is not that of the grid.
pub fn sun_error(grid: Equirect, prediction: &[f32], target: &[f32]) -> Option<f64> {
    let target = log_luminances(grid, target);
    let (mut mean, mut total) = (0.0, 0.0);
    for (k, ln) in target.iter().enumerate() {
        let weight = grid.solid_angle(k / grid.width);
        (mean, total) = (mean + weight * ln, total + weight);
    }
    let largest = target.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (largest - mean / total >= VISIBLE).then(|| {
        let (a, b) = (brightest(grid, &log_luminances(grid, prediction)), brightest(grid, &target));
        f64::from(angle(a, b).to_degrees())
    })
}

/// The direction (unit, z up) of the brightest light: the centre of the luminance within 10° of the brightest pixel.
fn brightest(grid: Equirect, log_luminances: &[f64]) -> [f32; 3] {
    let peak = (0..log_luminances.len())
        .max_by(|a, b| log_luminances[*a].total_cmp(&log_luminances[*b]))
        .unwrap_or(0);
    let directions = grid.directions();
    let (towards, near) = (directions[peak], GLOW.to_radians().cos());
    let mut sum = [0f32; 3];
    for (k, (direction, ln)) in directions.into_iter().zip(log_luminances).enumerate() {
        if dot(direction, towards) >= near {
            let weight = (ln - log_luminances[peak]).exp() * grid.solid_angle(k / grid.width);
            sum.iter_mut().zip(direction).for_each(|(sum, d)| *sum += weight as f32 * d);
        }
    }
    scaled(sum, 1.0 / length(sum))
}

fn log_luminances(grid: Equirect, image: &[f32]) -> Vec<f64> {
    assert_eq!(image.len(), 3 * grid.len(), "values of a {} × {} image", grid.width, grid.height);
    image.as_chunks::<3>().0.iter().map(|rgb| f64::from(log_luminance(*rgb))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Equirect = Equirect { width: 128, height: 64 };

    /// ln radiance 0 but for a sun of e⁸ in one pixel and a glow about it.
    fn sky(column: usize, row: usize) -> Vec<f32> {
        let sun = GRID.direction(column, row);
        let glow =
            |d: &[f32; 3]| 2.0 * (8.0 * (d.iter().zip(&sun).map(|(a, b)| a * b).sum::<f32>() - 1.0)).exp();
        let mut image: Vec<f32> = GRID.directions().iter().flat_map(|d| [glow(d); 3]).collect();
        image[3 * (row * GRID.width + column)..][..3].fill(8.0);
        image
    }

    #[test]
    fn the_sun_is_where_it_was_put() {
        for (column, row) in [(5, 20), (127, 31), (64, 2)] {
            let found = brightest(GRID, &log_luminances(GRID, &sky(column, row)));
            let put = GRID.direction(column, row);
            assert!(dot(found, put) > 0.5_f32.to_radians().cos(), "{found:?} {put:?}");
        }
    }

    #[test]
    fn the_error_is_the_angle_between_the_suns() {
        let target = sky(40, 24);
        assert!(sun_error(GRID, &target, &target).unwrap() < 1e-5);
        // sixteen columns: 45° of azimuth, at the elevation of that row
        let polar = GRID.polar(24);
        let expected =
            (polar.sin().powi(2) * 45.0_f64.to_radians().cos() + polar.cos().powi(2)).acos().to_degrees();
        let error = sun_error(GRID, &sky(56, 24), &target).unwrap();
        assert!((error - expected).abs() < 0.3, "{error} {expected}");
        // across the seam it is no farther
        let error = sun_error(GRID, &sky(8, 24), &sky(120, 24)).unwrap();
        assert!((error - expected).abs() < 0.3, "{error} {expected}");
    }

    #[test]
    fn exposure_changes_nothing_and_an_overcast_sky_has_no_sun() {
        let brighter: Vec<f32> = sky(40, 24).iter().map(|v| v + 5.0).collect();
        assert!(sun_error(GRID, &brighter, &sky(40, 24)).unwrap() < 1e-4);
        assert!(sun_error(GRID, &sky(40, 24), &brighter).is_some());
        let overcast: Vec<f32> = sky(40, 24).iter().map(|v| v.min(2.0)).collect();
        assert_eq!(sun_error(GRID, &sky(40, 24), &overcast), None);
    }
}
