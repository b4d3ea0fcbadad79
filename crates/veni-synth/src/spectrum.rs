//! Light in eight bands of wavelength, and what it is in Rec. 709.
//!
//! Scattering goes with λ⁻⁴ and the colours of dawn are differences of large optical depths, so three bands would
//! give wrong hues at low sun.

use glam::Vec3;

/// Number of bands.
pub(super) const BANDS: usize = 8;

/// One value per band; spectral radiance is in W m⁻² sr⁻¹ nm⁻¹.
pub(super) type Spectrum = [f32; BANDS];

/// Width of a band, nanometres.
const WIDTH: f32 = 40.0;

/// Middles of the bands, nanometres: 400, 440, …, 680.
pub(super) const WAVELENGTHS: Spectrum = [400.0, 440.0, 480.0, 520.0, 560.0, 600.0, 640.0, 680.0];

/// Sunlight above the atmosphere, W m⁻² nm⁻¹: the ASTM E490 spectrum averaged over each band.
pub(super) const SUN: Spectrum = [1.49, 1.85, 1.968, 1.873, 1.837, 1.745, 1.602, 1.480];

/// Absorption cross section of ozone, m² per molecule (Serdyuchenko et al. 2014, at 233 K), averaged over each band.
pub(super) const OZONE: Spectrum =
    [1.8e-27, 1.7e-26, 8.0e-26, 2.2e-25, 4.1e-25, 4.43e-25, 2.74e-25, 1.24e-25];

/// Lumens per watt at 555 nm, in thousands: radiance comes out in kcd/m².
const KILO_LUMENS: f32 = 0.683;

/// Rec. 709 radiance in kcd/m² (or illuminance in klx, for irradiance). The colour matching functions are those of
/// CIE 1931 in the fit of Wyman, Sloan & Shirley (JCGT 2013).
pub(super) fn to_rgb(spectrum: &Spectrum) -> Vec3 {
    let mut xyz = Vec3::ZERO;
    for (value, weight) in spectrum.iter().zip(matching()) {
        xyz += *value * *weight;
    }
    let rgb = Vec3::new(
        3.2406 * xyz.x - 1.5372 * xyz.y - 0.4986 * xyz.z,
        -0.9689 * xyz.x + 1.8758 * xyz.y + 0.0415 * xyz.z,
        0.0557 * xyz.x - 0.2040 * xyz.y + 1.0570 * xyz.z,
    );
    into_gamut(rgb)
}

/// Colours more saturated than Rec. 709 can say are moved towards grey at constant luminance.
fn into_gamut(rgb: Vec3) -> Vec3 {
    let y = luminance(rgb);
    let (low, floor) = (rgb.min_element(), 0.01 * y);
    if low >= floor || y <= 0.0 {
        return rgb.max(Vec3::ZERO);
    }
    Vec3::splat(y) + (rgb - y) * ((y - floor) / (y - low))
}

/// Rec. 709 luminance.
pub(super) fn luminance(rgb: Vec3) -> f32 {
    veni_image::luminance(rgb.to_array())
}

/// Colour matching functions times band width and luminous efficacy.
fn matching() -> &'static [Vec3; BANDS] {
    static WEIGHTS: std::sync::OnceLock<[Vec3; BANDS]> = std::sync::OnceLock::new();
    WEIGHTS.get_or_init(|| {
        WAVELENGTHS.map(|middle| {
            // four points in each band
            let points = [-0.375, -0.125, 0.125, 0.375].map(|t| middle + t * WIDTH);
            KILO_LUMENS * WIDTH * points.into_iter().map(cie1931).sum::<Vec3>() / 4.0
        })
    })
}

fn cie1931(wavelength: f32) -> Vec3 {
    let lobe = |height: f32, middle: f32, below: f32, above: f32| {
        let t = (wavelength - middle) / if wavelength < middle { below } else { above };
        height * (-0.5 * t * t).exp()
    };
    Vec3::new(
        lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sunlight_is_130_kilolux_and_nearly_white() {
        let sun = to_rgb(&SUN);
        // the solar illuminance constant is 128 to 134 klx, by source
        assert!((126.0..138.0).contains(&luminance(sun)), "{sun}");
        assert!(sun.max_element() < 1.25 * sun.min_element(), "{sun}");
        // a single red band lies outside Rec. 709 and is brought in without a change of luminance
        let mut red = [0.0; BANDS];
        red[6] = 1.0;
        let (rgb, y) = (to_rgb(&red), matching()[6].y);
        assert!(rgb.min_element() > 0.0 && (luminance(rgb) - y).abs() < 2e-3 * y, "{rgb}");
    }
}
