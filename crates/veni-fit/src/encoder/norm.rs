//! Layer norm of a vector feature, added to another.

use pulp::{Simd, WithSimd};

/// ε of the layer norm.
const EPSILON: f32 = 1e-5;
/// Least length that a vector is divided by.
const LEAST_LENGTH: f32 = 1e-6;

/// x ← x + LN(n)_c · y_c / max(n_c, 1e-6) with n_c = |y_c| over the coordinates: LN over the channels of a token,
/// biased variance, gain γ, no offset.
pub(super) struct AddNormalised<'a> {
    /// `[token, coordinate, width]`.
    pub(super) x: &'a mut [f32],
    /// As `x`.
    pub(super) y: &'a [f32],
    /// γ, zero after the last channel: `[width]`.
    pub(super) gamma: &'a [f32],
    pub(super) channels: usize,
    pub(super) coordinates: usize,
    /// Workspace.
    pub(super) lengths: &'a mut Vec<f32>,
}

impl AddNormalised<'_> {
    pub(super) fn run(self) {
        super::simd::dispatch(self);
    }
}

impl WithSimd for AddNormalised<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { x, y, gamma, channels, coordinates, lengths } = self;
        let width = gamma.len();
        lengths.resize(width, 0.0);
        let gamma = S::as_simd_f32s(gamma).0;
        let token = coordinates * width;
        for (x, y) in x.chunks_exact_mut(token).zip(y.chunks_exact(token)) {
            {
                let n = S::as_mut_simd_f32s(lengths).0;
                n.fill(simd.splat_f32s(0.0));
                for y in y.chunks_exact(width) {
                    for (n, y) in n.iter_mut().zip(S::as_simd_f32s(y).0) {
                        *n = simd.mul_add_e_f32s(*y, *y, *n);
                    }
                }
                for n in n {
                    *n = simd.sqrt_f32s(*n);
                }
            }
            let (mean, deviation) = moments(simd, &lengths[..channels]);
            let (mean, scale) = (simd.splat_f32s(mean), simd.splat_f32s(1.0 / deviation));
            let factors = S::as_mut_simd_f32s(lengths).0;
            for (n, gamma) in factors.iter_mut().zip(gamma) {
                let normalised = simd.mul_f32s(simd.mul_f32s(simd.sub_f32s(*n, mean), scale), *gamma);
                *n = simd.div_f32s(normalised, simd.max_f32s(*n, simd.splat_f32s(LEAST_LENGTH)));
            }
            for (x, y) in x.chunks_exact_mut(width).zip(y.chunks_exact(width)) {
                let (x, y) = (S::as_mut_simd_f32s(x).0, S::as_simd_f32s(y).0);
                for ((x, y), factor) in x.iter_mut().zip(y).zip(&*factors) {
                    *x = simd.mul_add_e_f32s(*y, *factor, *x);
                }
            }
        }
    }
}

/// Mean and √(variance + ε).
#[inline(always)]
fn moments<S: Simd>(simd: S, values: &[f32]) -> (f32, f32) {
    let (whole, rest) = S::as_simd_f32s(values);
    let count = values.len() as f32;
    let mut sum = simd.splat_f32s(0.0);
    for value in whole {
        sum = simd.add_f32s(sum, *value);
    }
    let mean = (simd.reduce_sum_f32s(sum) + rest.iter().sum::<f32>()) / count;
    let mut squares = simd.splat_f32s(0.0);
    for value in whole {
        let centred = simd.sub_f32s(*value, simd.splat_f32s(mean));
        squares = simd.mul_add_e_f32s(centred, centred, squares);
    }
    let mut variance = simd.reduce_sum_f32s(squares);
    for value in rest {
        variance += (value - mean) * (value - mean);
    }
    (mean, (variance / count + EPSILON).sqrt())
}
