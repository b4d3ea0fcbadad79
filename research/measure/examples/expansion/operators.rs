//! Published operators to compare with, on linear values where 1 is white.

use veni_core::expand::Analysis;
use veni_core::panorama::{Panorama, luminance};

/// H. Landis, "Production-ready global illumination" (SIGGRAPH 2002 course notes): above the threshold 0.5, values are
/// blended with `brightest` times themselves by the square of their height over it.
pub(crate) fn landis(linear: &Panorama, brightest: f32) -> Panorama {
    const THRESHOLD: f32 = 0.5;
    let mut out = linear.clone();
    for pixel in out.pixels_mut() {
        let height = ((luminance(*pixel) - THRESHOLD) / (1.0 - THRESHOLD)).clamp(0.0, 1.0);
        let blend = height * height;
        *pixel = pixel.map(|v| v * (1.0 - blend + blend * brightest));
    }
    out
}

/// F. Banterle et al., "Inverse tone mapping" (GRAPHITE 2006): the inverse of Reinhard's photographic operator, blended in by
/// an expand map. Here the map is the depth in clipped regions (0 at their border, near 1 innermost) in place of the
/// density of sampled lights. `white` is what the operator maps to 1, and with it the brightest value.
pub(crate) fn banterle(analysis: &Analysis, white: f32) -> Panorama {
    let mut out = analysis.linear().clone();
    for (pixel, _, x) in analysis.pixels() {
        let value = &mut out.pixels_mut()[pixel];
        let y = luminance(*value).min(1.0);
        let root = ((1.0 - y).powi(2) + 4.0 * y / (white * white)).sqrt();
        let expanded = 0.5 * white * white * (y - 1.0 + root);
        let map = 1.0 - (-x).exp();
        let factor = (1.0 - map) + map * expanded / y.max(1e-6);
        *value = value.map(|v| v * factor);
    }
    out
}
