//! The radiance of all directions, borrowed.

use crate::error::{Error, Result};
use crate::sphere::Equirect;

/// An equirectangular map of radiance: what every algorithm of [`light`](super) reads, whoever owns the pixels.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentMap<'a> {
    grid: Equirect,
    pixels: &'a [[f32; 3]],
}

impl<'a> EnvironmentMap<'a> {
    /// Row-major `pixels` (linear Rec. 709) on `grid`.
    ///
    /// # Errors
    /// [`Error`] of kind `Invalid` if the number of pixels is not the grid's, or a value is negative or not finite.
    pub fn new(grid: Equirect, pixels: &'a [[f32; 3]]) -> Result<Self> {
        if pixels.len() != grid.len() {
            return Err(Error::invalid(format!(
                "an environment map of {} × {} has {} pixels, got {}",
                grid.width,
                grid.height,
                grid.len(),
                pixels.len()
            )));
        }
        if let Some(at) = pixels.iter().position(|p| !p.iter().all(|v| v.is_finite() && *v >= 0.0)) {
            return Err(Error::invalid(format!(
                "radiance is finite and not negative; column {}, row {} has {:?}",
                at % grid.width,
                at / grid.width,
                pixels[at]
            )));
        }
        Ok(Self { grid, pixels })
    }

    /// Of pixels that are known to be right.
    pub(super) fn trusted(grid: Equirect, pixels: &'a [[f32; 3]]) -> Self {
        Self { grid, pixels }
    }

    /// The pixel grid.
    pub fn grid(self) -> Equirect {
        self.grid
    }

    /// Radiance, row-major.
    pub fn pixels(self) -> &'a [[f32; 3]] {
        self.pixels
    }

    /// The integral of radiance over the sphere, ∫ L dω, per channel.
    pub fn integral(self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (row, pixels) in self.pixels.chunks_exact(self.grid.width).enumerate() {
            let of_row = pixels.iter().fold([0.0; 3], |s, p| [0, 1, 2].map(|c| s[c] + f64::from(p[c])));
            let solid_angle = self.grid.solid_angle(row);
            sum = [0, 1, 2].map(|c| sum[c] + solid_angle * of_row[c]);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_map_holds_four_pi() {
        let grid = Equirect::new(16, 8);
        let pixels = vec![[1.0, 2.0, 0.5]; grid.len()];
        let sum = EnvironmentMap::new(grid, &pixels).unwrap().integral();
        for (sum, value) in sum.into_iter().zip([1.0, 2.0, 0.5]) {
            assert!((sum - value * 4.0 * std::f64::consts::PI).abs() < 1e-12);
        }
    }

    #[test]
    fn wrong_values_are_named() {
        let grid = Equirect::new(4, 2);
        let mut pixels = vec![[1.0; 3]; 8];
        assert!(EnvironmentMap::new(grid, &pixels[1..]).unwrap_err().to_string().contains("8 pixels, got 7"));
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            pixels[6][1] = bad;
            let message = EnvironmentMap::new(grid, &pixels).unwrap_err().to_string();
            assert!(message.contains("column 2, row 1"), "{message}");
        }
    }
}
