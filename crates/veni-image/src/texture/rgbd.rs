//! RGBD: radiance in an 8-bit image with alpha. Colour is (rgb · D)^(1/2.2), alpha is D ≤ 1, so that rgb · D ≤ 1 up to 255.

use crate::encoder::encoder;
use crate::{Error, Result};

/// The largest radiance: D is 1/255 at least.
const LARGEST: f32 = 255.0;

/// One texel.
pub fn rgbd(texel: [f32; 3]) -> [u8; 4] {
    let largest = texel.into_iter().fold(0f32, f32::max);
    // the largest whole D that keeps the brightest channel in range
    let d = (LARGEST / largest.max(1.0)).floor().clamp(1.0, 255.0) / 255.0;
    // D is D₂₅₅/255 and full scale is 1, so radiance 1 has D = 1
    let colour = texel.map(|v| ((v * d).clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0).round() as u8);
    [colour[0], colour[1], colour[2], (d * 255.0).round() as u8]
}

/// Radiance of a texel, as a renderer decodes it.
#[cfg(test)]
pub(crate) fn from_rgbd([r, g, b, d]: [u8; 4]) -> [f32; 3] {
    [r, g, b].map(|v| (f32::from(v) / 255.0).powf(2.2) / (f32::from(d) / 255.0))
}

/// A face of a cube as a PNG file, its last row first: Babylon.js uploads the images of faces upside down (`invertY`), so that the first
/// row of an image becomes the bottom of the face.
///
/// # Errors
/// [`Error::Invalid`] for a value that is negative, not finite, or beyond 255.
///
/// # Panics
/// If there are not `size`² texels.
pub fn rgbd_png(size: usize, texels: &[[f32; 3]]) -> Result<Vec<u8>> {
    assert_eq!(texels.len(), size * size, "texels of a square of {size}");
    if let Some(k) = texels.iter().position(|t| !t.iter().all(|v| (0.0..=LARGEST).contains(v))) {
        return Err(Error::invalid(format!("texel {k} is {:?}: RGBD holds 0 to {LARGEST}", texels[k])));
    }
    let wrong = |e: png::EncodingError| Error::invalid(format!("PNG: {e}"));
    let mut file = Vec::new();
    let encoder = encoder(&mut file, [size, size], png::ColorType::Rgba)?;
    let mut writer = encoder.write_header().map_err(wrong)?;
    let bytes: Vec<[u8; 4]> = texels.chunks_exact(size).rev().flatten().map(|t| rgbd(*t)).collect();
    writer.write_image_data(bytes.as_flattened()).map_err(wrong)?;
    writer.finish().map_err(wrong)?;
    Ok(file)
}
