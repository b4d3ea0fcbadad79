//! Making radiance positive and finite, as the reference implementation makes its training images.

use crate::panorama::{LOG_FLOOR, Panorama};
use crate::{Error, Result};

/// How many values [`sanitise_values`] replaced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sanitised {
    /// Values that were not a number, now the smallest positive one.
    pub nan: usize,
    /// Values that were +∞, now the largest finite one.
    pub infinite: usize,
    /// Values that were zero or negative (−∞ included), now the smallest positive one.
    pub not_positive: usize,
    /// Those of them that were below zero: filters with negative lobes leave such.
    pub negative: usize,
}

impl Sanitised {
    /// All replaced values.
    pub fn total(self) -> usize {
        self.nan + self.infinite + self.not_positive
    }

    /// What a person should know of it. Zeros are not worth a word.
    pub fn notes(self) -> Vec<String> {
        let Self { nan, infinite, negative, .. } = self;
        let mut notes = Vec::new();
        if nan + infinite > 0 {
            notes.push(format!(
                "{nan} values that are not a number and {infinite} infinite ones were replaced"
            ));
        }
        if negative > 0 {
            notes.push(format!("{negative} negative values were replaced by the smallest positive one"));
        }
        notes
    }
}

/// Replaces +∞ by the largest finite value, and every value ≤ 0 or NaN by the smallest positive one, both
/// taken over the whole slice. Afterwards every value is positive and finite.
///
/// # Errors
/// [`Error::Invalid`] if no value is positive and finite (an all-black or all-NaN image); nothing is changed then.
pub fn sanitise_values(values: &mut [f32]) -> Result<Sanitised> {
    let (mut smallest, mut largest) = (f32::INFINITY, 0f32);
    for &v in values.iter().filter(|v| v.is_finite() && **v > 0.0) {
        (smallest, largest) = (smallest.min(v), largest.max(v));
    }
    if largest == 0.0 {
        return Err(Error::invalid(format!(
            "none of the {} values is positive and finite: the image is black, empty or damaged",
            values.len()
        )));
    }
    let mut report = Sanitised::default();
    for v in values {
        if v.is_nan() {
            (report.nan, *v) = (report.nan + 1, smallest);
        } else if *v == f32::INFINITY {
            (report.infinite, *v) = (report.infinite + 1, largest);
        } else if *v <= 0.0 {
            report.negative += usize::from(*v < 0.0);
            (report.not_positive, *v) = (report.not_positive + 1, smallest);
        }
    }
    Ok(report)
}

/// The reference implementation's loading of an image with `channels` ≥ 3 interleaved channels: [`sanitise_values`]
/// over all of them (an alpha channel takes part in the extremes), then ln(v + [`LOG_FLOOR`]) of the first three.
///
/// # Errors
/// As [`sanitise_values`].
///
/// # Panics
/// If `channels` < 3 or does not divide the number of values.
#[doc(hidden)]
pub fn log_reference(values: &[f32], channels: usize) -> Result<Vec<[f32; 3]>> {
    let n = values.len();
    assert!(channels >= 3 && n.is_multiple_of(channels), "{n} values of {channels} channels");
    let mut values = values.to_vec();
    sanitise_values(&mut values)?;
    Ok(values.chunks_exact(channels).map(|p| [p[0], p[1], p[2]].map(|v| (v + LOG_FLOOR).ln())).collect())
}

impl Panorama {
    /// Makes every value positive and finite; see [`sanitise_values`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if no value is positive and finite.
    pub fn sanitise(&mut self) -> Result<Sanitised> {
        sanitise_values(self.pixels.as_flattened_mut())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn every_kind_of_bad_value_is_counted_and_replaced() {
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, -0.0];
        let mut values = [&bad[..], &[0.5, 2.0, 1e-3]].concat();
        let report = sanitise_values(&mut values).unwrap();
        assert_eq!(report, Sanitised { nan: 1, infinite: 1, not_positive: 4, negative: 2 });
        assert_eq!(report.total(), 6);
        let [replaced, negative] = &report.notes()[..] else { panic!("two notes: {:?}", report.notes()) };
        assert!(replaced.starts_with("1 values that are not a number and 1 infinite"), "{replaced}");
        assert!(negative.starts_with("2 negative"), "{negative}");
        assert!(Sanitised { not_positive: 7, ..Sanitised::default() }.notes().is_empty());
        assert_eq!(values, [1e-3, 2.0, 1e-3, 1e-3, 1e-3, 1e-3, 0.5, 2.0, 1e-3]);
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
