//! Metrics on plain slices; no tensors. Images are row-major, three channels last, and compared in f64.
//!
//! [`scores`] is the protocol of the papers' tables; the parts are public for other uses.

mod alignment;
mod correlation;
mod log_error;
mod psnr;
mod ssim;
mod sun;

pub use alignment::{Alignment, exposure_offset, log_factor};
pub use correlation::{pearson, ranks, spearman};
pub use log_error::{log_error, weighted_log_error};
pub use psnr::psnr;
pub use ssim::ssim;
pub use sun::sun_error;

use serde::Serialize;

use crate::tonemap::srgb_q98;

/// How close a prediction is to its target, or the mean of that over a set. Higher is better throughout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Peak signal-to-noise ratio of display values, dB.
    pub ldr_psnr: f64,
    /// The same of radiance; the peak is the target's range.
    pub hdr_psnr: f64,
    /// Structural similarity of display values.
    pub ssim: f64,
    /// Structural similarity of radiance; no table or record shows it.
    #[serde(skip)]
    pub hdr_ssim: f64,
}

impl Scores {
    /// The mean of each score; NaN of none.
    pub fn mean<'a>(each: impl IntoIterator<Item = &'a Self, IntoIter: Clone>) -> Self {
        let each = each.into_iter();
        let count = each.clone().count() as f64;
        let mean = |score: fn(&Self) -> f64| each.clone().map(score).sum::<f64>() / count;
        Self {
            ldr_psnr: mean(|s| s.ldr_psnr),
            hdr_psnr: mean(|s| s.hdr_psnr),
            ssim: mean(|s| s.ssim),
            hdr_ssim: mean(|s| s.hdr_ssim),
        }
    }
}

/// Compares two images of log radiance, `[height, width, 3]`.
///
/// The prediction is aligned first and both are exponentiated; display values are those of [`srgb_q98`],
/// each image under its own white. No solid-angle weights, as in the papers.
///
/// # Panics
/// If a length is not height · width · 3.
pub fn scores(
    prediction: &[f32],
    target: &[f32],
    height: usize,
    width: usize,
    alignment: Alignment,
) -> Scores {
    let shape = [height, width, 3];
    let aligned = alignment.apply(prediction, target, height);
    let p: Vec<f64> = aligned.iter().map(|v| v.exp()).collect();
    let i: Vec<f64> = target.iter().map(|v| f64::from(*v).exp()).collect();
    let display = |radiance: &[f64]| -> Vec<f64> {
        let radiance: Vec<f32> = radiance.iter().map(|v| *v as f32).collect();
        srgb_q98(&radiance).0.into_iter().map(f64::from).collect()
    };
    let (p_ldr, i_ldr) = (display(&p), display(&i));
    Scores {
        hdr_psnr: psnr(&p, &i),
        ldr_psnr: psnr(&p_ldr, &i_ldr),
        hdr_ssim: ssim(&p, &i, shape),
        ssim: ssim(&p_ldr, &i_ldr, shape),
    }
}

#[cfg(test)]
mod tests;
