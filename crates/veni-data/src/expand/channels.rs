//! Pixels that are clipped in some channels only.

use veni_image::Panorama;

/// Factors between channels beyond this are noise of dark values, not hue.
const MAX_RATIO: f32 = 8.0;

/// Rebuilds clipped channels of pixels that have others left: each is the mean of those others, times the
/// ratio of the two in the nearest unclipped pixel, and at least what is stored. `nearest[k]` is that pixel.
pub(super) fn rebuild(linear: &mut Panorama, clipped: &[[bool; 3]], nearest: &[u32]) {
    let source = linear.pixels().to_vec();
    for ((pixel, flags), &from) in linear.pixels_mut().iter_mut().zip(clipped).zip(nearest) {
        let left = flags.iter().filter(|c| !**c).count();
        let Some(model) = source.get(from as usize).filter(|_| left == 1 || left == 2) else { continue };
        let mean = |colour: &[f32; 3]| {
            let values = colour.iter().zip(flags).filter(|(_, clipped)| !**clipped).map(|(v, _)| *v);
            values.sum::<f32>() / left as f32
        };
        let (here, there) = (mean(pixel), mean(model));
        if there <= 0.0 {
            continue;
        }
        for (c, _) in flags.iter().enumerate().filter(|(_, clipped)| **clipped) {
            let ratio = (model[c] / there).min(MAX_RATIO);
            pixel[c] = pixel[c].max(here * ratio);
        }
    }
}
