//! Exposure: the mean of ln(luminance), which is subtracted from log radiance before encoding and fitting, and added back
//! after decoding. MODEL (3).
//!
//! Luminance is Rec. 709's ([`luminance`]); all logarithms are natural. A panorama weights its pixels by solid angle
//! ([`over_sphere`]), a picture of which only a part is known by what is known ([`over_pixels`]).

use veni_light::sphere::Equirect;

use crate::luminance;

/// The mean of one number per pixel, row by row, over the whole sphere.
///
/// # Panics
/// If there are not exactly W·H numbers.
pub fn over_sphere(grid: Equirect, log_luminances: &[f64]) -> f32 {
    assert_eq!(log_luminances.len(), grid.len(), "a {} × {} grid", grid.width, grid.height);
    let rows = log_luminances.chunks_exact(grid.width).enumerate();
    let total: f64 = rows.map(|(j, row)| row.iter().sum::<f64>() * grid.solid_angle(j)).sum();
    (total / (4.0 * std::f64::consts::PI)) as f32
}

/// The mean of one number per pixel by these weights, of which 0 takes a pixel out; NaN if all are 0.
pub fn over_pixels(log_luminances: &[f64], weights: &[f64]) -> f32 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (value, weight) in log_luminances.iter().zip(weights) {
        sum += weight * value;
        total += weight;
    }
    (sum / total) as f32
}

/// ln(luminance) of log radiance, for values whose radiance f32 cannot hold, too.
pub fn log_luminance(log_radiance: [f32; 3]) -> f32 {
    // factor the largest channel out: exp cannot overflow, ln never sees 0
    let top = log_radiance.into_iter().fold(f32::NEG_INFINITY, f32::max);
    top + luminance(log_radiance.map(|v| (v - top).exp())).ln()
}

/// The exposure of an image of log radiance (H × W × 3).
///
/// # Panics
/// If the image does not have 3·W·H values.
pub fn log_exposure(grid: Equirect, log_radiance: &[f32]) -> f32 {
    assert_eq!(log_radiance.len(), 3 * grid.len(), "log radiance of a {} × {} grid", grid.width, grid.height);
    let logs = log_radiance.as_chunks().0.iter().map(|pixel| f64::from(log_luminance(*pixel)));
    over_sphere(grid, &logs.collect::<Vec<_>>())
}

/// Brings an image of log radiance (H × W × 3) to exposure 0 and returns the exposure that was subtracted.
///
/// # Panics
/// If the image does not have 3·W·H values.
pub fn centre_exposure(grid: Equirect, log_radiance: &mut [f32]) -> f32 {
    let exposure = log_exposure(grid, log_radiance);
    log_radiance.iter_mut().for_each(|v| *v -= exposure);
    exposure
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Panorama;

    #[test]
    fn grey_has_its_own_level_whatever_the_rows() {
        let grid = Equirect::new(8, 4);
        let mut image = vec![700.0; 3 * grid.len()];
        // e^700 overflows f32: the mean is taken without leaving the log domain
        assert!((centre_exposure(grid, &mut image) - 700.0).abs() < 1e-3);
        assert!(image.iter().all(|v| v.abs() < 1e-3));
    }

    #[test]
    fn rows_count_by_solid_angle() {
        let grid = Equirect::new(4, 4);
        let mut image = vec![0.0; 3 * grid.len()];
        image[..12].fill(1.0);
        let expected = 4.0 * grid.solid_angle(0) / (4.0 * std::f64::consts::PI);
        assert!((f64::from(log_exposure(grid, &image)) - expected).abs() < 1e-6);
    }

    #[test]
    fn radiance_log_radiance_and_weighted_pixels_agree() {
        let grid = Equirect::new(16, 8);
        let sky = Panorama::from_fn(grid, |[x, y, z]| [1.5 + x, 1.2 + y, 2.0 + z]);
        let expected = sky.mean_log_luminance();
        assert!((log_exposure(grid, sky.log().as_flattened()) - expected).abs() < 1e-5);
        let logs: Vec<f64> = sky.pixels().iter().map(|p| f64::from(luminance(*p)).ln()).collect();
        let areas: Vec<f64> = (0..grid.len()).map(|p| grid.solid_angle(p / grid.width)).collect();
        assert!((over_pixels(&logs, &areas) - expected).abs() < 1e-5);
        // a pixel without weight does not count
        let (mut odd, mut some) = (logs, areas);
        (odd[5], some[5]) = (1e9, 0.0);
        assert!((over_pixels(&odd, &some) - expected).abs() < 0.1);
    }

    /// Encoded latents and training sets depend on how these sums are rounded.
    #[test]
    fn means_are_rounded_as_ever() {
        let grid = Equirect::new(16, 8);
        let at = |k: usize| ((k * 37 % 101) as f32 / 25.0 - 2.0, (k * 53 % 89) as f32 / 30.0);
        let image: Vec<f32> = (0..3 * grid.len()).map(|k| at(k).0 * at(k).1).collect();
        let pixels: Vec<[f32; 3]> =
            image.as_chunks().0.iter().map(|p: &[f32; 3]| p.map(|v| v * v + 0.01)).collect();
        let mean = Panorama::new(grid, pixels).mean_log_luminance();
        assert_eq!([log_exposure(grid, &image), mean].map(f32::to_bits), [0x3f6aa925, 0x3f6d0b87]);
    }
}
