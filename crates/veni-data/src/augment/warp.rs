//! Augmentations that move a panorama's pixels.

use veni_light::sphere::Equirect;

/// Exchanges left and right (y → −y).
pub fn mirror(grid: Equirect, image: &mut [f32]) {
    for row in image.chunks_exact_mut(3 * grid.width) {
        for i in 0..grid.width / 2 {
            for c in 0..3 {
                row.swap(3 * i + c, 3 * (grid.width - 1 - i) + c);
            }
        }
    }
}

/// Shifts the image `columns` to the right, wrapping: a rotation by −2π·columns/W about z.
pub fn rotate_columns(grid: Equirect, image: &mut [f32], columns: usize) {
    for row in image.chunks_exact_mut(3 * grid.width) {
        row.rotate_right(3 * (columns % grid.width));
    }
}

/// Moves content along meridians: the new row at polar angle θ shows what was at θ + amplitude·sin(2θ)/2.
/// Poles and horizon stay; for |amplitude| < 1 the map is monotone, so nothing is seen twice. Linear
/// interpolation of log radiance between rows.
pub fn polar_warp(grid: Equirect, image: &[f32], amplitude: f64) -> Vec<f32> {
    let stride = 3 * grid.width;
    let mut out = Vec::with_capacity(image.len());
    for j in 0..grid.height {
        let theta = grid.polar(j);
        let source = theta + 0.5 * amplitude * (2.0 * theta).sin();
        let position =
            (source / std::f64::consts::PI * grid.height as f64 - 0.5).clamp(0.0, (grid.height - 1) as f64);
        let low = (position as usize).min(grid.height.saturating_sub(2));
        let high = (low + 1).min(grid.height - 1);
        let t = (position - low as f64) as f32;
        let (a, b) = (&image[low * stride..][..stride], &image[high * stride..][..stride]);
        out.extend(a.iter().zip(b).map(|(a, b)| a + t * (b - a)));
    }
    out
}

/// Moves content along parallels: the new column at azimuth φ shows what was at φ + amplitude·sin(φ − bearing).
/// For |amplitude| < 1 the map is monotone and goes round once. Linear interpolation of log radiance between
/// columns, wrapped at the seam.
pub fn azimuth_warp(grid: Equirect, image: &[f32], amplitude: f64, bearing: f64) -> Vec<f32> {
    let width = grid.width;
    let columns: Vec<_> = (0..width)
        .map(|i| {
            let azimuth = grid.azimuth(i);
            let source = azimuth + amplitude * (azimuth - bearing).sin();
            let position = (0.5 - source / std::f64::consts::TAU) * width as f64 - 0.5;
            let low = position.floor();
            let wrap = |x: f64| x.rem_euclid(width as f64) as usize % width;
            (3 * wrap(low), 3 * wrap(low + 1.0), (position - low) as f32)
        })
        .collect();
    let mut out = Vec::with_capacity(image.len());
    for row in image.chunks_exact(3 * width) {
        for &(low, high, t) in &columns {
            out.extend((0..3).map(|c| row[low + c] + t * (row[high + c] - row[low + c])));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::augment::tests::{GRID, image};

    #[test]
    fn mirror_and_rotations_permute_columns() {
        let a = image(3);
        let mut b = a.clone();
        mirror(GRID, &mut b);
        assert_eq!(b[0..3], a[3 * 15..3 * 16]);
        mirror(GRID, &mut b);
        assert_eq!(a, b);
        rotate_columns(GRID, &mut b, 5);
        assert_eq!(b[15..18], a[0..3]);
        rotate_columns(GRID, &mut b, 11);
        assert_eq!(a, b);
    }

    #[test]
    fn polar_warp_keeps_order_and_moves_elevation() {
        // a ramp in θ: values must stay monotone, the horizon must stay in the middle
        let ramp: Vec<f32> =
            (0..GRID.height).flat_map(|j| std::iter::repeat_n(j as f32, 3 * GRID.width)).collect();
        for amplitude in [-0.9, 0.9] {
            let out = polar_warp(GRID, &ramp, amplitude);
            let column: Vec<_> = out.chunks_exact(3 * GRID.width).map(|r| r[0]).collect();
            // strictly, except where the first and last rows are held beyond their centres
            assert!(column.windows(2).all(|w| w[1] >= w[0]), "{column:?}");
            assert!(column[2..6].windows(2).all(|w| w[1] > w[0]), "{column:?}");
            // symmetric about the horizon
            assert!((column[3] + column[4] - 7.0).abs() < 1e-4);
            let shift = 0.5 * amplitude * (2.0 * GRID.polar(2)).sin();
            let expected = 2.0 + GRID.height as f64 / std::f64::consts::PI * shift;
            assert!((f64::from(column[2]) - expected).abs() < 1e-5);
        }
        assert_eq!(polar_warp(GRID, &ramp, 0.0), ramp);
    }

    #[test]
    fn azimuth_warp_moves_azimuths_by_the_sine_of_their_distance_to_its_bearing() {
        let a = image(8);
        let still = azimuth_warp(GRID, &a, 0.0, 1.0);
        assert!(still.iter().zip(&a).all(|(x, y)| (x - y).abs() < 1e-5));
        // the azimuth itself, as a phase: the warped phase must be φ + a sin(φ − φ₀) up to interpolation
        let grid = Equirect::new(256, 2);
        let phase: Vec<f32> = (0..grid.len())
            .flat_map(|p| {
                let azimuth = grid.azimuth(p % grid.width);
                [azimuth.cos() as f32, azimuth.sin() as f32, 0.0]
            })
            .collect();
        let out = azimuth_warp(grid, &phase, 0.8, 0.7);
        for i in 0..grid.width {
            let azimuth = grid.azimuth(i);
            let expected = azimuth + 0.8 * (azimuth - 0.7).sin();
            assert!((f64::from(out[3 * i]) - expected.cos()).abs() < 3e-4);
            assert!((f64::from(out[3 * i + 1]) - expected.sin()).abs() < 3e-4);
        }
    }
}
