//! A smooth function on rings of latitude, interpolated anywhere by Lagrange polynomials through 6 × 6 samples.

use crate::light::angle::pixel;
use crate::sphere::Equirect;

/// Samples on each side of a place.
const REACH: usize = 3;

/// Samples at the pixel centres of a grid, with borders: columns wrap, rows go on beyond a pole half a turn away.
pub(in crate::light) struct Rings {
    grid: Equirect,
    stride: usize,
    samples: Vec<[f32; 3]>,
}

impl Rings {
    /// The grid's width is even.
    pub(super) fn new(grid: Equirect, pixels: &[[f32; 3]]) -> Self {
        let Equirect { width, height } = grid;
        let stride = width + 2 * REACH;
        let mut samples = Vec::with_capacity(stride * (height + 2 * REACH));
        for j in -(REACH as isize)..(height + REACH) as isize {
            let (row, turn) = if j < 0 {
                ((-1 - j) as usize, width / 2)
            } else if j as usize >= height {
                (2 * height - 1 - j as usize, width / 2)
            } else {
                (j as usize, 0)
            };
            let row = &pixels[row * width..][..width];
            samples.extend((0..stride).map(|i| row[(i + width - REACH + turn) % width]));
        }
        Self { grid, stride, samples }
    }

    /// The value in a unit direction.
    #[inline]
    pub(in crate::light) fn at(&self, direction: [f32; 3]) -> [f32; 3] {
        let [x, y] = pixel(self.grid, direction);
        let (column, across) = split(x);
        let (row, down) = split(y);
        let mut sum = [0.0; 3];
        for (j, down) in down.into_iter().enumerate() {
            let samples = &self.samples[(row + j) * self.stride + column..][..2 * REACH];
            let mut line = [0.0; 3];
            for (sample, across) in samples.iter().zip(across) {
                line = [0, 1, 2].map(|c| line[c] + across * sample[c]);
            }
            sum = [0, 1, 2].map(|c| sum[c] + down * line[c]);
        }
        sum
    }
}

/// The first of six padded samples around a continuous pixel coordinate (centres at halves), and their weights.
#[inline]
fn split(at: f32) -> (usize, [f32; 2 * REACH]) {
    let at = at - 0.5;
    let low = at.floor();
    let t = at - low;
    // nodes at −2 … 3
    let (a, b, c, d, e, f) = (t + 2.0, t + 1.0, t, t - 1.0, t - 2.0, t - 3.0);
    let weights = [
        b * c * d * e * f / -120.0,
        a * c * d * e * f / 24.0,
        a * b * d * e * f / -12.0,
        a * b * c * e * f / 12.0,
        a * b * c * d * f / -24.0,
        a * b * c * d * e / 120.0,
    ];
    // low is −1 at least, and the border is one wider than the reach to the left
    ((low as isize - 2 + REACH as isize) as usize, weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_met_and_smooth_functions_followed() {
        let grid = Equirect::new(64, 32);
        let f = |[x, y, z]: [f32; 3]| [x, y * z, 1.0 + x * x * y];
        let rings = Rings::new(grid, &grid.directions().into_iter().map(f).collect::<Vec<_>>());
        for d in grid.directions() {
            for (a, b) in rings.at(d).into_iter().zip(f(d)) {
                assert!((a - b).abs() < 1e-5, "{d:?}");
            }
        }
        for d in Equirect::new(101, 77).directions() {
            for (a, b) in rings.at(d).into_iter().zip(f(d)) {
                assert!((a - b).abs() < 1e-5, "{d:?}: {a} for {b}");
            }
        }
    }
}
