//! Pictures: how noisy, and written as PNG.

use std::path::Path;

use veni_image::{luminance, tonemap::srgb};
use veni_light::output::Overwrite;

use crate::Result;

/// Mean luminance of two independent pictures of the same scene, and the variance of one of them per pixel over the squared
/// mean: half the mean squared difference, whatever numbers the samples were made of.
pub(crate) fn mean_and_variance(a: &[[f32; 3]], b: &[[f32; 3]]) -> [f64; 2] {
    let (mut sum, mut squares) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let [a, b] = [*a, *b].map(|rgb| f64::from(luminance(rgb)));
        sum += 0.5 * (a + b);
        squares += 0.5 * (a - b) * (a - b);
    }
    let mean = sum / a.len() as f64;
    [mean, squares / a.len() as f64 / (mean * mean)]
}

/// Exposes by the geometric mean of the picture, bends it by ACES' curve (K. Narkowicz' fit), and writes 8-bit sRGB.
pub(crate) fn write_png(path: &Path, [width, height]: [u32; 2], radiance: &[[f32; 3]]) -> Result<()> {
    let logs: f64 = radiance.iter().map(|&rgb| f64::from(luminance(rgb).max(1e-6)).ln()).sum();
    let exposure = 0.20 / (logs / radiance.len() as f64).exp() as f32;
    let aces = |v: f32| v * (2.51 * v + 0.03) / (v * (2.43 * v + 0.59) + 0.14);
    let byte = |v: f32| (255.0 * srgb(aces(exposure * v).clamp(0.0, 1.0)) + 0.5) as u8;
    let pixels: Vec<[u8; 3]> = radiance.iter().map(|rgb| rgb.map(byte)).collect();
    Ok(veni_image::write_png(path, [width as usize, height as usize], &pixels, Overwrite::Replace)?)
}
