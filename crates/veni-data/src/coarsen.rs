//! Fewer pixels for losses that need not see every one.

use veni_light::sphere::Equirect;

/// The grid of `factor` × `factor` cells.
///
/// # Panics
/// If `factor` does not divide both sides.
pub fn coarse_grid(grid: Equirect, factor: usize) -> Equirect {
    let (width, height) = (grid.width, grid.height);
    let divides = factor > 0 && width.is_multiple_of(factor) && height.is_multiple_of(factor);
    assert!(divides, "cells of {factor} pixels do not tile {width} × {height}");
    Equirect::new(width / factor, height / factor)
}

/// Mean of an image (H × W × 3) over cells of `factor` × `factor` pixels, weighted by solid angle. Of log
/// radiance this is the geometric mean of radiance, the value that a log error would choose for the cell.
///
/// # Panics
/// If `factor` does not divide both sides, or the image has another size.
pub fn averaged(grid: Equirect, image: &[f32], factor: usize) -> Vec<f32> {
    let coarse = coarse_grid(grid, factor);
    assert_eq!(image.len(), 3 * grid.len(), "an image of {} × {} pixels", grid.width, grid.height);
    let mut out = Vec::with_capacity(3 * coarse.len());
    for j in 0..coarse.height {
        let weights: Vec<f64> = (0..factor).map(|k| grid.solid_angle(j * factor + k)).collect();
        let total = weights.iter().sum::<f64>() * factor as f64;
        for i in 0..coarse.width {
            let mut sum = [0.0; 3];
            for (k, weight) in weights.iter().enumerate() {
                let first = 3 * ((j * factor + k) * grid.width + i * factor);
                for pixel in image[first..first + 3 * factor].chunks_exact(3) {
                    sum.iter_mut().zip(pixel).for_each(|(s, v)| *s += weight * f64::from(*v));
                }
            }
            out.extend(sum.map(|s| (s / total) as f32));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_weighted_by_solid_angle() {
        let grid = Equirect::new(8, 4);
        let ramp: Vec<f32> = (0..grid.len()).flat_map(|p| [p as f32; 3]).collect();
        let (top, below) = (grid.solid_angle(0), grid.solid_angle(1));
        let expected = (top * 0.5 + below * 8.5) / (top + below);
        assert!((f64::from(averaged(grid, &ramp, 2)[0]) - expected).abs() < 1e-6);
        assert_eq!(averaged(grid, &[2.5; 96], 4), [2.5; 6]);
        assert_eq!(averaged(grid, &ramp, 1), ramp);
    }
}
