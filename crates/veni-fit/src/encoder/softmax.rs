//! Softmax over rows of logits.

use pulp::{Simd, WithSimd};

/// 1.5·2²³: adding it to a small number rounds it to the nearest integer, which then sits in the low bits.
const ROUND: f32 = 12_582_912.0;
/// Below it e^x is taken as e^LEAST, the smallest normal number.
const LEAST: f32 = -87.33;
/// Σ cᵢ rⁱ ≈ e^r on |r| ≤ ½ ln 2: the Taylor series to r⁷, whose error there is below 5e-9.
const COEFFICIENTS: [f32; 8] = [1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0];

/// e^(x − max)/Σ e^(x − max) over the first `count` numbers of every row of `stride`.
pub(super) struct Softmax<'a> {
    pub(super) rows: &'a mut [f32],
    /// A whole number of vectors.
    pub(super) stride: usize,
    pub(super) count: usize,
}

impl Softmax<'_> {
    pub(super) fn run(self) {
        super::simd::dispatch(self);
    }
}

impl WithSimd for Softmax<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, stride, count } = self;
        for row in rows.chunks_exact_mut(stride) {
            row[count..].fill(f32::MIN);
            let row = S::as_mut_simd_f32s(row).0;
            let mut largest = simd.splat_f32s(f32::MIN);
            for x in &*row {
                largest = simd.max_f32s(largest, *x);
            }
            let largest = simd.splat_f32s(simd.reduce_max_f32s(largest));
            let mut sum = simd.splat_f32s(0.0);
            for x in &mut *row {
                *x = exp(simd, simd.sub_f32s(*x, largest));
                sum = simd.add_f32s(sum, *x);
            }
            let scale = simd.splat_f32s(1.0 / simd.reduce_sum_f32s(sum));
            for x in row {
                *x = simd.mul_f32s(*x, scale);
            }
        }
    }
}

/// e^x for x ≤ 0: 2ⁿ e^r with x = n ln 2 + r.
#[inline(always)]
fn exp<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    let x = simd.max_f32s(x, simd.splat_f32s(LEAST));
    let shifted = simd.mul_add_f32s(x, simd.splat_f32s(std::f32::consts::LOG2_E), simd.splat_f32s(ROUND));
    let n = simd.sub_f32s(shifted, simd.splat_f32s(ROUND));
    // ln 2 in two parts, the first exact in products with n
    let r = simd.mul_add_f32s(n, simd.splat_f32s(-0.693_359_4), x);
    let r = simd.mul_add_f32s(n, simd.splat_f32s(2.121_944_4e-4), r);
    let mut series = simd.splat_f32s(COEFFICIENTS[7]);
    for c in COEFFICIENTS[..7].iter().rev() {
        series = simd.mul_add_f32s(series, r, simd.splat_f32s(*c));
    }
    // 2ⁿ: n in the exponent's bits, −126 ≤ n ≤ 0
    let bias = simd.splat_u32s(ROUND.to_bits().wrapping_sub(127));
    let exponent = simd.sub_u32s(simd.transmute_u32s_f32s(shifted), bias);
    let power = simd.wrapping_dyn_shl_u32s(exponent, simd.splat_u32s(23));
    simd.mul_f32s(series, simd.transmute_f32s_u32s(power))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_those_of_double_precision() {
        let (count, stride) = (45, 64);
        let x: Vec<f32> = (0..3 * stride).map(|i| 40.0 * (1.7 * i as f32).sin() - 500.0).collect();
        let mut rows = x.clone();
        Softmax { rows: &mut rows, stride, count }.run();
        for (x, row) in x.chunks_exact(stride).zip(rows.chunks_exact(stride)) {
            let power = |v: &f32| (f64::from(*v) + 500.0).exp();
            let sum: f64 = x[..count].iter().map(power).sum();
            for (x, got) in x[..count].iter().zip(row) {
                let expected = power(x) / sum;
                assert!((f64::from(*got) - expected).abs() <= 3e-7 * expected + 1e-37, "{got} {expected}");
            }
        }
    }
}
