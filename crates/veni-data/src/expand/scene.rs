//! What the whole panorama tells about the light that its clipped regions have lost: the ground was lit by it.

use super::regions::OUTSIDE;
use veni_image::tonemap::quantile;
use veni_image::{Panorama, luminance};

/// Directions with z below this are ground.
const GROUND: f64 = -0.1;
/// Ground of ln balance below this says nothing of the sky: it is dark earth, or in the shade.
const DARKEST: f64 = -2.5;
/// Luminance below this is noise of 8-bit values.
const NOISE: f32 = 1e-4;

/// Features that all regions of a panorama share.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Scene {
    /// ln(mean ground luminance / irradiance from what is seen of the sky) above −2.5: a diffuse ground of albedo ρ has
    /// ln(ρ/π), about −2.7, if nothing is missing, and more under a sun that was clipped.
    pub(super) balance: f64,
    /// ln(median / 10 % quantile) of the ground's luminance: the sun casts shadows.
    pub(super) shadows: f64,
    /// ln of the irradiance of a surface that faces up, from the panorama clipped at white.
    pub(super) irradiance: f64,
}

impl Scene {
    /// From linear values and the labels of clipped regions, which do not count as ground.
    pub(super) fn new(linear: &Panorama, labels: &[u32]) -> Self {
        let grid = linear.grid();
        let (mut irradiance, mut ground) = (0.0, [0.0; 2]);
        let mut luminances = Vec::new();
        for (k, pixel) in linear.pixels().iter().enumerate() {
            let cosine = grid.polar(k / grid.width).cos();
            let weight = grid.solid_angle(k / grid.width) * cosine.abs();
            let y = luminance(*pixel).max(NOISE);
            if cosine > 0.0 {
                irradiance += weight * f64::from(y.min(1.0));
            } else if cosine < GROUND && labels[k] == OUTSIDE {
                ground[0] += weight * f64::from(y);
                ground[1] += weight;
                luminances.push(y);
            }
        }
        let irradiance = irradiance.max(f64::from(NOISE)).ln();
        if luminances.is_empty() {
            return Self { irradiance, ..Self::default() };
        }
        Self {
            balance: ((ground[0] / ground[1]).ln() - irradiance).max(DARKEST) - DARKEST,
            shadows: f64::from((quantile(&luminances, 0.5) / quantile(&luminances, 0.1)).ln()),
            irradiance,
        }
    }
}
