//! The panorama: linear radiance on an equirectangular grid.

use std::collections::BTreeMap;

use veni_light::sphere::Equirect;

use crate::{exposure, luminance};

/// Added to radiance before the logarithm, ln(L + 1e-8), so that the darkest values stay bounded.
pub const LOG_FLOOR: f32 = 1e-8;

/// Linear Rec. 709 radiance on an equirectangular grid, with the text attributes of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    pub(crate) grid: Equirect,
    pub(crate) pixels: Vec<[f32; 3]>,
    pub(crate) attributes: BTreeMap<String, String>,
    /// How much of each pixel is known, 0 to 1, unless all of all is.
    pub(crate) known: Option<Vec<f32>>,
    pub(crate) notes: Vec<String>,
}

impl Panorama {
    /// A panorama from row-major pixels.
    ///
    /// # Panics
    /// If there are not exactly W·H pixels.
    pub fn new(grid: Equirect, pixels: Vec<[f32; 3]>) -> Self {
        let Equirect { width, height } = grid;
        assert_eq!(pixels.len(), grid.len(), "a {width} × {height} panorama got {} pixels", pixels.len());
        Self { grid, pixels, attributes: BTreeMap::new(), known: None, notes: Vec::new() }
    }

    /// A panorama from natural-log radiance, the inverse of [`Panorama::log`] up to [`LOG_FLOOR`].
    ///
    /// # Panics
    /// If there are not exactly W·H pixels.
    pub fn from_log(grid: Equirect, log_radiance: &[[f32; 3]]) -> Self {
        Self::new(grid, log_radiance.iter().map(|pixel| pixel.map(f32::exp)).collect())
    }

    /// A panorama whose pixels are computed from their unit directions.
    pub fn from_fn(grid: Equirect, radiance: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        Self::new(grid, grid.directions().into_iter().map(radiance).collect())
    }

    /// The pixel grid.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// Linear radiance, row-major.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// Linear radiance, row-major, to be changed in place.
    pub fn pixels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }

    /// The radiance alone, as the algorithms of [`veni_light::light`] take it.
    ///
    /// # Errors
    /// [`veni_light::Error`] of kind `Invalid` if a value is negative or not finite; it names the pixel.
    pub fn environment(&self) -> veni_light::Result<veni_light::light::EnvironmentMap<'_>> {
        veni_light::light::EnvironmentMap::new(self.grid, &self.pixels)
    }

    /// The pixels alone.
    pub fn into_pixels(self) -> Vec<[f32; 3]> {
        self.pixels
    }

    /// Radiance of one pixel.
    ///
    /// # Panics
    /// If the column or row lies outside the grid.
    pub fn pixel(&self, column: usize, row: usize) -> [f32; 3] {
        let Equirect { width, height } = self.grid;
        assert!(column < width && row < height, "pixel ({column}, {row}) of a {width} × {height} panorama");
        self.pixels[row * width + column]
    }

    /// The text attributes of the file this was read from.
    pub fn attributes(&self) -> &BTreeMap<String, String> {
        &self.attributes
    }

    /// How much of each pixel is known, 0 to 1, row-major; `None` if all of all. What is transparent in its file, or lies
    /// outside of the part that the file holds, is unknown; its radiance is 0 until [`Panorama::fill`].
    pub fn known(&self) -> Option<&[f32]> {
        self.known.as_deref()
    }

    /// Share of the pixels (0 to 1) of which less than half is known.
    pub fn unknown(&self) -> f64 {
        unknown_share(self.known.as_deref())
    }

    /// What its file says that is not applied, or is worth knowing; sentences without the file's name.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Natural-log radiance ln(L + [`LOG_FLOOR`]), row-major: what encoder and losses work on. The panorama
    /// must be clean ([`Panorama::sanitise`]); a negative value gives NaN.
    pub fn log(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|pixel| pixel.map(|v| (v + LOG_FLOOR).ln())).collect()
    }

    /// Solid-angle-weighted mean of ln(luminance + [`LOG_FLOOR`]) over the sphere: the `log_exposure` that is
    /// subtracted from the log radiance before encoding and added back after decoding.
    pub fn mean_log_luminance(&self) -> f32 {
        let logs = self.pixels.iter().map(|&p| f64::from(luminance(p) + LOG_FLOOR).ln());
        exposure::over_sphere(self.grid, &logs.collect::<Vec<_>>())
    }

    /// Multiplies every value by `factor`.
    pub fn scale(&mut self, factor: f32) {
        for pixel in &mut self.pixels {
            *pixel = pixel.map(|v| v * factor);
        }
    }
}

/// Share of the pixels of which less than half is known.
pub(crate) fn unknown_share(known: Option<&[f32]>) -> f64 {
    let Some(known) = known else { return 0.0 };
    let hidden = known.iter().filter(|k| **k < 0.5).count();
    hidden as f64 / known.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_is_a_shift_of_the_mean_log_luminance() {
        let grid = Equirect::new(16, 8);
        let mut sky = Panorama::from_fn(grid, |[x, y, z]| [1.5 + x, 1.5 + y, 2.0 + z]);
        let before = sky.mean_log_luminance();
        sky.scale(3.0);
        assert!((sky.mean_log_luminance() - before - 3f32.ln()).abs() < 1e-6);
        let uniform = Panorama::new(grid, vec![[2.0; 3]; grid.len()]);
        assert!((uniform.mean_log_luminance() - 2f32.ln()).abs() < 1e-6);
    }

    #[test]
    fn log_and_back() {
        let grid = Equirect::new(8, 4);
        let sky = Panorama::from_fn(grid, |[x, _, z]| [1.0 + x * 0.9, 100.0 + z, 0.01]);
        let back = Panorama::from_log(grid, &sky.log());
        for (a, b) in sky.pixels().iter().flatten().zip(back.pixels().iter().flatten()) {
            assert!((a - b).abs() <= 2e-6 * a, "{a} came back as {b}");
        }
    }
}
