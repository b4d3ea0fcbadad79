//! Exposure 0: the solid-angle-weighted mean of ln(luminance) is 0. MODEL (3).

use veni_image::LUMINANCE;
use veni_light::sphere::Equirect;

/// ∫ ln Y dω / 4π of an image of log radiance (H × W × 3), Y the Rec. 709 luminance.
///
/// # Panics
/// If the image does not have 3·W·H values.
pub fn log_exposure(grid: Equirect, log_radiance: &[f32]) -> f32 {
    assert_eq!(log_radiance.len(), 3 * grid.len(), "log radiance of a {} × {} grid", grid.width, grid.height);
    let mut sum = 0.0;
    for (j, row) in log_radiance.chunks_exact(3 * grid.width).enumerate() {
        let row_sum: f64 = row
            .chunks_exact(3)
            .map(|pixel| {
                // factor the largest channel out: exp cannot overflow, ln never sees 0
                let top = pixel.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                let y: f32 = pixel.iter().zip(LUMINANCE).map(|(v, w)| w * (v - top).exp()).sum();
                f64::from(top + y.ln())
            })
            .sum();
        sum += row_sum * grid.solid_angle(j);
    }
    (sum / (4.0 * std::f64::consts::PI)) as f32
}

/// Brings the image to exposure 0 and returns the log exposure that was subtracted.
pub fn centre_exposure(grid: Equirect, log_radiance: &mut [f32]) -> f32 {
    let exposure = log_exposure(grid, log_radiance);
    log_radiance.iter_mut().for_each(|v| *v -= exposure);
    exposure
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
