//! Mean squared errors in three spaces, with an optional mask. MODEL (31).

use super::LossForm;
use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};
use veni_image::tonemap::srgb::{GAMMA, KNEE, OFFSET, SCALE, SLOPE};

/// Where radiance is compared. Inputs are log radiance always.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LossSpace {
    /// Log radiance.
    Log,
    /// Linear radiance.
    Hdr,
    /// Display values: divided by the target's 98 % quantile, clamped to `[0, 1]`, sRGB curve.
    Ldr,
}

/// The mean squared error. `rows` are weights per row (`[1, H, 1, 1]`), `mask` `[1 or B, H, W, 1]` says how
/// much each pixel counts (1 everywhere where absent).
///
/// Corrected: Σ w d²/Σ w, w = rows × mask. Reference: mean((w d)²), the weight inside the square and not
/// divided out; and the reference's "LDR" error is computed in log space. `[B, H, W, 3]` → `[1]`.
pub fn mse(
    form: LossForm,
    space: LossSpace,
    prediction: Tensor<4>,
    target: Tensor<4>,
    rows: Tensor<4>,
    mask: Option<Tensor<4>>,
) -> Tensor<1> {
    let [batch, height, width, _] = prediction.dims();
    let weights = match mask {
        Some(mask) => rows * mask,
        None => rows,
    };
    let (p, i) = match (space, form) {
        (LossSpace::Log, _) | (LossSpace::Ldr, LossForm::Reference) => (prediction, target),
        (LossSpace::Hdr, _) => (prediction.exp(), target.exp()),
        (LossSpace::Ldr, LossForm::Corrected) => {
            let white = white_point(&target);
            (display(prediction, white.clone()), display(target, white))
        }
    };
    let error = p - i;
    match form {
        LossForm::Reference => {
            let error = error * weights;
            (error.clone() * error).mean()
        }
        LossForm::Corrected => {
            let total = weights.clone().expand([batch, height, width, 1]).mean();
            (error.clone() * error * weights).mean() / total
        }
    }
}

/// The log of each target's 98 % quantile over all its values, `[B, 1, 1, 1]`; a constant.
fn white_point(target: &Tensor<4>) -> Tensor<4> {
    let [batch, height, width, channels] = target.dims();
    let flat = target.clone().detach().reshape([batch, height * width * channels]);
    let rank = 0.98 * (height * width * channels - 1) as f64;
    let (below, part) = (rank.floor() as usize, rank.fract());
    let sorted = flat.sort(1);
    // Between neighbours the quantile is interpolated in radiance, not in its logarithm.
    let value = |k: usize| sorted.clone().narrow(1, k.min(height * width * channels - 1), 1).exp();
    (value(below) * (1.0 - part) + value(below + 1) * part).log().reshape([batch, 1, 1, 1])
}

/// e^(x − white) clamped to `[0, 1]`, through the sRGB curve.
fn display(log_radiance: Tensor<4>, white: Tensor<4>) -> Tensor<4> {
    let x = (log_radiance - white).clamp_max(0.0).exp();
    let linear = x.clone() * SLOPE;
    // The power's derivative is infinite at 0, where it is not used: guarded, lest the unused branch give NaN.
    let curved = x.clone().clamp_min(KNEE).powf_scalar(1.0 / GAMMA) * SCALE - OFFSET;
    curved.mask_where(x.lower_elem(KNEE), linear)
}

/// Only the brightest part of each target: the mean squared log error over the values of an image that are
/// among its ⌊`fraction` · count⌋ largest. The reference implementation divides by the number of all values instead.
/// `[B, ..]` → `[1]`.
///
/// # Panics
/// If that is not a single value.
#[doc(hidden)]
pub fn brightest<const D: usize>(
    form: LossForm,
    fraction: f64,
    prediction: Tensor<D>,
    target: Tensor<D>,
) -> Tensor<1> {
    let batch = prediction.dims()[0];
    let count = prediction.dims().iter().skip(1).product::<usize>();
    let kept = (fraction * count as f64) as usize;
    assert!((1..=count).contains(&kept), "a fraction of {fraction} of {count} values is {kept} values");
    let (prediction, target) = (prediction.reshape([batch, count]), target.reshape([batch, count]));
    let threshold = target.clone().detach().sort_descending(1).narrow(1, kept - 1, 1);
    let bright = target.clone().detach().greater_equal(threshold).float();
    let error = prediction - target;
    let total = (error.clone() * error * bright.clone()).mean();
    match form {
        LossForm::Reference => total,
        LossForm::Corrected => total / bright.mean(),
    }
}
