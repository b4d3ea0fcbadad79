//! Making radiance finite and not negative.

use crate::panorama::{LOG_FLOOR, Panorama};
use crate::{Error, Result};

/// What [`Panorama::sanitise`] replaced.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sanitised {
    /// Values that were not a number; their pixels now have the radiance of what is around them.
    pub nan: usize,
    /// Values that were +∞, now the largest finite one.
    pub infinite: usize,
    /// Values below zero, −∞ included, now zero: filters with negative lobes and colours beyond Rec. 709 leave such.
    pub negative: usize,
    /// The largest finite value.
    pub largest: f32,
}

impl Sanitised {
    /// All replaced values.
    pub fn total(self) -> usize {
        self.nan + self.infinite + self.negative
    }

    /// What a person should know of it.
    pub fn notes(self) -> Vec<String> {
        let Self { nan, infinite, negative, largest } = self;
        let mut notes = Vec::new();
        if nan > 0 {
            notes.push(format!(
                "{nan} values are not a number: their pixels were filled from their surroundings"
            ));
        }
        if infinite > 0 {
            notes.push(format!(
                "{infinite} values are infinite: they count as the largest finite one, {largest}"
            ));
        }
        if negative > 0 {
            notes.push(format!("{negative} values are negative: they count as 0"));
        }
        notes
    }
}

impl Panorama {
    /// Makes every value finite and at least 0: +∞ becomes the largest finite value, a negative one 0, and a pixel with NaN
    /// gets the radiance of what is around it ([`Panorama::fill`]). Zero stays zero: what it stands for in a logarithm is
    /// [`Panorama::darkest`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if no value is positive and finite (an all-black or all-NaN image); nothing is changed then.
    pub fn sanitise(&mut self) -> Result<Sanitised> {
        let mut found = Sanitised::default();
        for &value in self.pixels.as_flattened() {
            if value.is_finite() {
                found.largest = found.largest.max(value);
            }
            found.nan += usize::from(value.is_nan());
            found.infinite += usize::from(value == f32::INFINITY);
            found.negative += usize::from(value < 0.0);
        }
        if found.largest == 0.0 {
            return Err(Error::invalid(format!(
                "none of the {} values is positive and finite: the image is black, empty or damaged",
                3 * self.pixels.len()
            )));
        }
        if found.total() == 0 {
            return Ok(found);
        }
        for value in self.pixels.as_flattened_mut() {
            // NaN stays
            if *value == f32::INFINITY {
                *value = found.largest;
            } else if *value < 0.0 {
                *value = 0.0;
            }
        }
        if found.nan > 0 {
            let whole = |pixel: &[f32; 3]| if pixel.iter().any(|v| v.is_nan()) { 0.0 } else { 1.0 };
            let known = self.pixels.iter().map(whole).collect();
            let before = self.known.replace(known);
            self.fill();
            self.known = before;
        }
        Ok(found)
    }
}

/// The reference implementation's loading of an image with `channels` ≥ 3 interleaved channels: +∞ becomes the largest finite
/// value, every value ≤ 0 or NaN the smallest positive one, both taken over all channels (alpha takes part); then
/// ln(v + [`LOG_FLOOR`]) of the first three.
///
/// # Errors
/// [`Error::Invalid`] if no value is positive and finite.
///
/// # Panics
/// If `channels` < 3 or does not divide the number of values.
#[doc(hidden)]
pub fn log_reference(values: &[f32], channels: usize) -> Result<Vec<[f32; 3]>> {
    let n = values.len();
    assert!(channels >= 3 && n.is_multiple_of(channels), "{n} values of {channels} channels");
    let usable = || values.iter().copied().filter(|v| v.is_finite() && *v > 0.0);
    let [smallest, largest] = [usable().reduce(f32::min), usable().reduce(f32::max)];
    let (Some(smallest), Some(largest)) = (smallest, largest) else {
        return Err(Error::invalid(format!("none of the {n} values is positive and finite")));
    };
    let clean = |v: f32| {
        if v == f32::INFINITY {
            largest
        } else if v > 0.0 {
            v
        } else {
            smallest
        }
    };
    Ok(values
        .chunks_exact(channels)
        .map(|p| [p[0], p[1], p[2]].map(|v| (clean(v) + LOG_FLOOR).ln()))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn every_kind_of_bad_value_is_counted_and_replaced() {
        let grid = Equirect::new(4, 2);
        let mut pixels = vec![[0.5, 2.0, 1e-3]; 8];
        pixels[1] = [f32::INFINITY, f32::NEG_INFINITY, -1.0];
        pixels[2] = [0.0, -0.0, 0.25];
        pixels[3][1] = f32::NAN;
        let mut image = Panorama::new(grid, pixels);
        let report = image.sanitise().unwrap();
        assert_eq!(report, Sanitised { nan: 1, infinite: 1, negative: 2, largest: 2.0 });
        assert_eq!(report.total(), 4);
        let [nan, infinite, negative] = &report.notes()[..] else { panic!("three: {:?}", report.notes()) };
        assert!(nan.starts_with("1 values are not a number"), "{nan}");
        assert!(infinite.starts_with("1 values are infinite") && infinite.ends_with(", 2"), "{infinite}");
        assert!(negative.starts_with("2 values are negative"), "{negative}");
        // zero is zero, and nothing is known of a pixel with NaN but what is around it
        assert_eq!(image.pixels()[1..3], [[2.0, 0.0, 0.0], [0.0, 0.0, 0.25]]);
        let filled = image.pixels()[3];
        assert!(filled.iter().all(|v| (1e-4..2.0).contains(v)), "{filled:?}");
        assert!(image.known().is_none() && image.pixels()[0] == [0.5, 2.0, 1e-3]);
        assert_eq!(image.sanitise().unwrap().total(), 0);
    }

    /// Lamps on black: the black has no light, whatever the darkest lamp is.
    #[test]
    fn black_stays_black_and_has_a_logarithm() {
        let grid = Equirect::new(16, 8);
        let mut pixels = vec![[0.0; 3]; 128];
        pixels[20] = [10.0, 8.0, 4.0];
        let mut image = Panorama::new(grid, pixels);
        assert_eq!(image.sanitise().unwrap().total(), 0);
        let mean = 22.0 / (3.0 * 128.0);
        assert!((image.darkest() / (1e-4 * mean) - 1.0).abs() < 1e-5, "{}", image.darkest());
        let log = image.log();
        assert!((log[0][0] - (1e-4f32 * mean + LOG_FLOOR).ln()).abs() < 1e-4, "{}", log[0][0]);
        assert!((log[20][2] - 4f32.ln()).abs() < 1e-6);
        assert!((image.mean_log_luminance() - log[0][0]).abs() < 0.2);
        // one dark channel among lit ones
        image.pixels_mut()[5] = [0.0, 2.0, 0.0];
        assert!((image.log()[5][0] - (0.02f32 * 0.7152).ln()).abs() < 1e-4, "{}", image.log()[5][0]);
        // where the file has darker values than that, zero is no brighter than they
        image.pixels_mut()[3] = [1e-9; 3];
        assert_eq!(image.darkest(), 1e-9);
    }

    #[test]
    fn nothing_positive_is_an_error_and_changes_nothing() {
        let grid = Equirect::new(4, 2);
        for poison in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let mut image = Panorama::new(grid, vec![[poison; 3]; 8]);
            assert!(image.sanitise().unwrap_err().to_string().contains("24 values"));
            assert!(image.pixels()[0][0].to_bits() == poison.to_bits());
        }
    }
}
