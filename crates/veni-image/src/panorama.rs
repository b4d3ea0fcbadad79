//! The panorama: linear radiance on an equirectangular grid.

use std::collections::BTreeMap;

use veni_light::sphere::Equirect;

use crate::provenance::Provenance;
use crate::{exposure, luminance};

/// Added to radiance before the logarithm, ln(L + 1e-8), so that the darkest values stay bounded: of panoramas whose
/// mean luminance lies within 2⁻¹² and 2¹². That of others is as much smaller or larger as they are
/// ([`Panorama::log_floor`]).
pub const LOG_FLOOR: f32 = 1e-8;

/// Of the mean radiance: what a value of 0 stands for in a logarithm, where nothing that is darker is known. A ten-thousandth of the
/// light more is no other light, and the deep shadows of photographs lie there.
pub const DARK_SHARE: f64 = 1e-4;

/// Of the luminance of its pixel: what a channel of 0 counts as in a logarithm, where others have light.
const LEAST_CHANNEL: f32 = 0.01;

/// Octaves of mean luminance to either side of 1 in which [`LOG_FLOOR`] is what it says.
const ORDINARY: f64 = 12.0;

/// Linear Rec. 709 radiance on an equirectangular grid, with the text attributes of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    pub(crate) grid: Equirect,
    pub(crate) pixels: Vec<[f32; 3]>,
    pub(crate) attributes: BTreeMap<String, String>,
    pub(crate) provenance: Provenance,
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
        Self {
            grid,
            pixels,
            attributes: BTreeMap::new(),
            provenance: Provenance::Unrecorded,
            known: None,
            notes: Vec::new(),
        }
    }

    /// A panorama from natural-log radiance, the inverse of [`Panorama::log`] up to [`Panorama::log_floor`].
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

    /// Whether the file that this was read from still had the pixels that its attributes were written with. Where it had
    /// not, what they say of the pixels is not so, and no factor was divided out.
    pub fn provenance(&self) -> Provenance {
        self.provenance
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

    /// For readers, as soon as attributes and the values as they are stored are there.
    pub(crate) fn note_provenance(&mut self) {
        self.provenance = Provenance::of(&self.attributes, self.grid, &self.pixels);
    }

    /// The power of two nearest to the mean luminance of the pixels, or 1 if that is within 2⁻¹² and 2¹²: what a radiance that is
    /// small or large for this panorama is measured by.
    pub fn unit(&self) -> f32 {
        let sum: f64 = self.pixels.iter().map(|&p| f64::from(luminance(p))).sum();
        let octaves = (sum / self.pixels.len() as f64).log2();
        // a black panorama has -∞ octaves, a damaged one NaN
        if octaves.is_finite() && octaves.abs() > ORDINARY { octaves.round().exp2() as f32 } else { 1.0 }
    }

    /// What is added to radiance before the logarithm: [`LOG_FLOOR`] times [`Panorama::unit`], so that a panorama in
    /// other units has the same log radiance but for a constant.
    pub fn log_floor(&self) -> f32 {
        LOG_FLOOR * self.unit()
    }

    /// What a value of 0 stands for in a logarithm: the smallest positive value, or a ten-thousandth of the mean of all values if
    /// that is less. (The smallest alone would be a lamp, where lamps are on black.) 0 for a black panorama.
    pub fn darkest(&self) -> f32 {
        let values = self.pixels.as_flattened();
        let sum: f64 = values.iter().map(|v| f64::from(*v)).sum();
        let positive = values.iter().copied().filter(|v| *v > 0.0);
        positive.fold((DARK_SHARE * sum / values.len() as f64) as f32, f32::min)
    }

    /// Natural-log radiance ln(L + [`Panorama::log_floor`]), row-major: what encoder and losses work on. A channel of 0 counts as a
    /// hundredth of its pixel's luminance, a black pixel as [`Panorama::darkest`]. The panorama must be clean
    /// ([`Panorama::sanitise`]); a negative value gives NaN.
    pub fn log(&self) -> Vec<[f32; 3]> {
        let (floor, zero) = (self.log_floor(), self.zero());
        self.pixels.iter().map(|&pixel| without_zeros(pixel, zero).map(|v| (v + floor).ln())).collect()
    }

    /// Solid-angle-weighted mean of ln(luminance + [`Panorama::log_floor`]) over the sphere: the `log_exposure` that is
    /// subtracted from the log radiance before encoding and added back after decoding; 0 counts as [`Panorama::darkest`].
    pub fn mean_log_luminance(&self) -> f32 {
        let (floor, zero) = (self.log_floor(), self.zero());
        let logs = self.pixels.iter().map(|&p| {
            let l = luminance(p);
            f64::from(if l == 0.0 { zero } else { l } + floor).ln()
        });
        exposure::over_sphere(self.grid, &logs.collect::<Vec<_>>())
    }

    /// Replaces every 0 by what it counts as in [`Panorama::log`].
    pub fn replace_zeros(&mut self) {
        let zero = self.zero();
        if zero > 0.0 {
            self.pixels.iter_mut().for_each(|pixel| *pixel = without_zeros(*pixel, zero));
        }
    }

    /// [`Panorama::darkest`], for which all pixels are looked at, where there is a 0.
    fn zero(&self) -> f32 {
        if self.pixels.as_flattened().contains(&0.0) { self.darkest() } else { 0.0 }
    }

    /// Multiplies every value by `factor`.
    pub fn scale(&mut self, factor: f32) {
        for pixel in &mut self.pixels {
            *pixel = pixel.map(|v| v * factor);
        }
    }
}

/// A pixel as a logarithm takes it: a channel of 0 counts as a hundredth of its pixel's luminance, and at least as `zero`. Files of eight
/// bits to a channel and a common exponent cannot tell less, and colours outside of Rec. 709 end at 0.
pub fn without_zeros(pixel: [f32; 3], zero: f32) -> [f32; 3] {
    if pixel.iter().all(|v| *v != 0.0) {
        return pixel;
    }
    let least = zero.max(LEAST_CHANNEL * luminance(pixel));
    pixel.map(|v| if v == 0.0 { least } else { v })
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

    /// Units of radiance are a matter of taste: whatever they are, the log radiance differs by a constant only, and so
    /// does the exposure. A black corner shows the floor.
    #[test]
    fn the_floor_follows_the_units() {
        let grid = Equirect::new(32, 16);
        let sky = |factor: f32| {
            let radiance = |[x, y, z]: [f32; 3]| {
                if x > 0.9 { [1e-7 * factor; 3] } else { [2.0 + x, 1.5 + y, 1.1 + z].map(|v| v * factor) }
            };
            Panorama::from_fn(grid, radiance)
        };
        let one = sky(1.0);
        assert_eq!((one.unit(), one.log_floor()), (1.0, LOG_FLOOR));
        for factor in [1e-8, 1e8, 1e-24, 1e24] {
            let other = sky(factor);
            let shift = factor.ln();
            assert!((other.mean_log_luminance() - one.mean_log_luminance() - shift).abs() < 0.01, "{factor}");
            // the unit is a power of two, the factor is not: the floor is off by a factor of √2 at most
            let (bright, dark) = (0, 8 * 32 + 16);
            let differs = |at: usize| (other.log()[at][1] - one.log()[at][1] - shift).abs();
            assert!(one.pixels()[dark][1] < 1e-6 && one.pixels()[bright][1] > 0.5);
            assert!(
                differs(bright) < 1e-5 && differs(dark) < 0.1,
                "{factor}: {} {}",
                differs(bright),
                differs(dark)
            );
        }
        // a power of two changes nothing but that
        let (a, b) = (sky(1e-8), sky(1e-8 * 0.125));
        assert!(a.pixels().iter().zip(b.pixels()).all(|(a, b)| a[0] * 0.125 == b[0]));
        assert_eq!(a.log_floor() * 0.125, b.log_floor());
        assert_eq!(Panorama::new(grid, vec![[0.0; 3]; grid.len()]).unit(), 1.0);
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
