//! What half precision does to values, and the powers of two that bring them into its range.

use half::f16;

/// The numbers that half precision keeps to 11 bits: the smallest and the largest. Below, bits are lost one by one.
pub const HALF_RANGE: [f32; 2] = [6.103_515_6e-5, 65_504.0];

/// What happens to values beyond the range of half precision. They never become infinite.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum HalfRange {
    /// Refuse to write the file if a value is larger than [`HALF_RANGE`], or is not 0 and smaller.
    #[default]
    Refuse,
    /// Multiply all values by the power of two that brings the brightest into range, and the darkest as far as the
    /// brightest allows, and record it as [`RADIANCE_SCALE`](super::RADIANCE_SCALE). Only for whole panoramas:
    /// [`write_rows`](super::write_rows) cannot know them beforehand.
    Fit,
    /// Multiply all values by this factor and record it; what is still too large is refused, what is still small loses
    /// bits.
    Factor(f32),
}

/// The factor of [`HalfRange::Fit`].
pub(super) fn fit(pixels: &[[f32; 3]]) -> f32 {
    let [least, most] = HALF_RANGE.map(f64::from);
    let sizes = pixels.as_flattened().iter().map(|v| f64::from(v.abs())).filter(|v| *v > 0.0);
    let (low, high) = sizes.fold((f64::INFINITY, 0f64), |(low, high), v| (low.min(v), high.max(v)));
    if high == 0.0 {
        return 1.0;
    }
    let headroom = (most / high).log2().floor();
    let wanted = (least / low).log2().ceil().max(0.0);
    // a factor that is itself a number
    wanted.min(headroom).clamp(-126.0, 126.0).exp2() as f32
}

/// The largest [`half_error`] with which a panorama is worth keeping in half precision; ordinary ones have 2e-4.
pub const HALF_ERROR: f64 = 1.0 / 1024.0;

/// The mean relative error of half precision over the values of `pixels` times `factor`; zeros count as kept. Infinite if one
/// value is too large.
pub fn half_error(pixels: &[[f32; 3]], factor: f32) -> f64 {
    let values = pixels.as_flattened();
    let error = |v: &f32| {
        let value = v * factor;
        if *v == 0.0 {
            return 0.0;
        }
        if value.abs() > HALF_RANGE[1] {
            return f64::INFINITY;
        }
        let half = f16::from_f32(value).to_f32();
        f64::from((half - value).abs() / value.abs()).min(1.0)
    };
    values.iter().map(error).sum::<f64>() / values.len().max(1) as f64
}

/// The values that half precision does not keep, as they go by.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Dark {
    pub(super) count: usize,
    /// The smallest of them.
    pub(super) darkest: f32,
}

impl Dark {
    pub(super) fn see(&mut self, value: f32) {
        let size = value.abs();
        if size > 0.0 && size < HALF_RANGE[0] {
            self.add(Self { count: 1, darkest: size });
        }
    }

    pub(super) fn add(&mut self, other: Self) {
        if other.count > 0 {
            self.darkest = if self.count == 0 { other.darkest } else { self.darkest.min(other.darkest) };
            self.count += other.count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_powers_of_two_that_fit() {
        let of = |values: [f32; 3]| fit(&[values]);
        assert_eq!(of([0.0, 1.0, 60_000.0]), 1.0);
        assert_eq!(of([0.0; 3]), 1.0);
        assert_eq!(of([0.0, 1.0, 65_504.0]), 1.0);
        assert_eq!(of([0.0, 1.0, 65_505.0]), 0.5);
        assert_eq!(of([6.104e-5, 1.0, 2.0]), 1.0);
        assert_eq!(of([6.1e-5, 1.0, 2.0]), 2.0);
        // the brightest goes first
        assert_eq!(of([1e-9, 1.0, 30_000.0]), 2.0);
        assert_eq!(of([1e-9, 1.0, 1e6]), 0.0625);
        assert_eq!(of([1e-9, 1e-8, 1e-7]), (6.103_515_6e-5f64 / 1e-9).log2().ceil().exp2() as f32);
        assert_eq!(of([1e-45, 0.0, 0.0]), 126f32.exp2());
    }

    #[test]
    fn errors_by_hand() {
        assert_eq!(half_error(&[[1.0, 0.0, 2.0]], 1.0), 0.0);
        // 1 + 2^-12 is rounded to 1
        let one = half_error(&[[1.0 + 1.0 / 4096.0, 1.0, 1.0]], 1.0);
        assert!((one - 1.0 / 4097.0 / 3.0).abs() < 1e-9, "{one}");
        // 2^-26 is nothing, 2^-24 is the smallest half
        let dark = [[(-26f32).exp2(), (-24f32).exp2(), 1.0]];
        assert!((half_error(&dark, 1.0) - 1.0 / 3.0).abs() < 1e-9);
        assert_eq!(half_error(&dark, 4.0), 0.0);
        assert_eq!(half_error(&[[1e5, 1.0, 1.0]], 1.0), f64::INFINITY);
        assert!(half_error(&[[65_510.0, 1.0, 1.0]], 1.0) > HALF_ERROR);
    }
}
