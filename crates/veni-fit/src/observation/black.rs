//! What stands for black: 0 has no logarithm, but a known pixel of 0 is known to be dark.
//!
//! Radiance of 0 is the smallest value that the picture has, and at most [`DARK_SHARE`] of its mean: lamps on black leave no darker value
//! than themselves, and would otherwise be as bright as what is between them. Against the mean, that much is nothing.
//!
//! Display values of 0 (the black of a JPEG) are anything that was rounded or cut off to 0. They are the smallest value that a pixel
//! of the picture has, and at most the first step of 8 bits: nothing darker can be said of them, and a larger number would make
//! shadows of what was clipped as dark as the picture's next tone. The mean of a cell of such pixels is raised to that too, as a few
//! ones among zeros are rounding.

use veni_image::{DARK_SHARE, Picture};

/// The first step of 8 bits coded as sRGB, of white. [`Picture::clip`] is one step below white, which is near enough.
const STEP: f32 = 1.0 / (255.0 * 12.92);

/// The radiance that stands for the black of a picture of display values; nothing for one of radiance.
pub(super) fn of_display(picture: &Picture) -> Option<f32> {
    let step = STEP * picture.clip()?;
    let known = |p: usize| picture.known().is_none_or(|known| known[p] > 0.0);
    let pixels = picture.pixels().iter().enumerate().filter(|(p, _)| known(*p));
    let values = pixels.flat_map(|(_, pixel)| pixel).filter(|v| **v > 0.0);
    Some(values.copied().fold(step, f32::min))
}

/// The radiance that stands for the black of pixels with these weights (0: unknown); nothing if none is positive.
pub(super) fn of_radiance(pixels: &[[f32; 3]], weights: &[f64]) -> Option<f32> {
    let known = pixels.iter().zip(weights).filter(|(_, weight)| **weight > 0.0);
    let values = known.flat_map(|(pixel, _)| pixel).filter(|v| **v > 0.0);
    let least = values.copied().reduce(f32::min)?;
    // of a mean that is hardly a number itself, the part may be none
    Some(least.min((DARK_SHARE * mean(pixels, weights)) as f32).max(f32::MIN_POSITIVE.min(least)))
}

/// The mean of all channels of pixels with these weights, of which one at least is not 0; what is negative counts as 0.
pub(crate) fn mean(pixels: &[[f32; 3]], weights: &[f64]) -> f64 {
    let (mut sum, mut whole) = (0.0, 0.0);
    for (pixel, weight) in pixels.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
        sum += weight * pixel.iter().map(|v| f64::from(v.max(0.0))).sum::<f64>();
        whole += 3.0 * weight;
    }
    sum / whole
}
