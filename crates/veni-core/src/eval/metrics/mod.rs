//! Metrics on plain slices; no tensors. Images are row-major, three channels last, and compared in f64.
//!
//! [`scores`] is the protocol of the papers' tables; the parts are public for other uses.

mod alignment;
mod correlation;
mod display;
mod psnr;
mod ssim;

pub use alignment::{Alignment, exposure_offset, log_factor};
pub use correlation::{pearson, ranks, spearman};
pub use display::{display, quantile, srgb};
pub use psnr::psnr;
pub use ssim::ssim;

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

/// Compares two images of log radiance, [height][width][3].
///
/// The prediction is aligned first, both are exponentiated, and for display values each image is divided
/// by its own 98 % quantile and put through the sRGB curve, clamped to [0, 1]. No solid-angle weights, as
/// in the papers.
///
/// # Panics
/// If a length is not height · width · 3.
pub fn scores(prediction: &[f32], target: &[f32], height: usize, width: usize, alignment: Alignment) -> Scores {
    let shape = [height, width, 3];
    let aligned = alignment.apply(prediction, target, height);
    let (p, i): (Vec<f64>, Vec<f64>) =
        (aligned.iter().map(|v| v.exp()).collect(), target.iter().map(|v| f64::from(*v).exp()).collect());
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
