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

/// How close a prediction is to its target. Higher is better throughout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// Peak signal-to-noise ratio of radiance, dB; the peak is the target's range.
    pub psnr_hdr: f64,
    /// The same of display values.
    pub psnr_ldr: f64,
    /// Structural similarity of radiance.
    pub ssim_hdr: f64,
    /// Structural similarity of display values.
    pub ssim_ldr: f64,
}

/// Scores of one panorama or their mean over a set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeanScores {
    /// Peak signal-to-noise ratio of the display values, dB.
    pub ldr_psnr: f64,
    /// Peak signal-to-noise ratio of linear radiance, dB.
    pub hdr_psnr: f64,
    /// Structural similarity of the display values.
    pub ssim: f64,
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
        psnr_hdr: psnr(&p, &i),
        psnr_ldr: psnr(&p_ldr, &i_ldr),
        ssim_hdr: ssim(&p, &i, shape),
        ssim_ldr: ssim(&p_ldr, &i_ldr, shape),
    }
}

#[cfg(test)]
mod tests;
