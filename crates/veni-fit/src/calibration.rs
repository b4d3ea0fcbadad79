//! The exposure at which a code lights surfaces as its panorama does. MODEL (84).

use veni_light::light::{Lights, luminance};
use veni_light::sphere::{Equirect, ways};
use veni_light::vector::dot;

/// No code is so far off; beyond, something else is wrong than the exposure.
const MOST: f64 = 2.0;
/// Steps of Gauss and Newton; it converges in four or five.
const STEPS: usize = 20;

/// The change δ of the log exposure of a field, its lights left as they are, that brings the irradiance of surfaces facing
/// 26 ways nearest to the truth: the least Σ ln²((E_L + e^δ E_f)/(E_L + E_r)).
///
/// A field of log radiance that is smoother than its panorama has the mean of the logarithm, which lies below the logarithm of the
/// mean: surfaces under it are too dark.
///
/// `rest` is the log radiance of the panorama without its `lights`, `decoded` that of the field in the same unit, both `[H, W, 3]`
/// on `grid`. Within ±2; 0 where nothing is lit.
///
/// # Panics
/// If one of the two does not have 3·W·H values.
pub fn lit_exposure(grid: Equirect, rest: &[f32], decoded: &[f32], lights: &Lights) -> f32 {
    assert!([rest.len(), decoded.len()] == [3 * grid.len(); 2], "an image has another size than its grid");
    let (rest, field) = (irradiance(grid, rest), irradiance(grid, decoded));
    let of_lights = |way: [f32; 3]| -> f64 {
        let each = lights.iter().map(|light| {
            let cosine = dot(light.direction, way);
            f64::from(cosine.max(0.0) * luminance(light.irradiance))
        });
        each.sum()
    };
    let lights: Vec<f64> = ways().into_iter().map(of_lights).collect();
    let mut change = 0.0f64;
    for _ in 0..STEPS {
        let (mut along, mut square) = (0.0, 0.0);
        for ((l, r), f) in lights.iter().zip(&rest).zip(&field) {
            let (found, truth) = (l + change.exp() * f, l + r);
            if found > 0.0 && truth > 0.0 {
                let by = 1.0 - l / found;
                along += by * (found / truth).ln();
                square += by * by;
            }
        }
        if square == 0.0 {
            break;
        }
        change = (change - along / square).clamp(-MOST, MOST);
    }
    change as f32
}

/// The irradiance (luminance) of a surface facing each of the [`ways`].
fn irradiance(grid: Equirect, log_radiance: &[f32]) -> Vec<f64> {
    let directions = grid.directions();
    let lit: Vec<f64> = log_radiance
        .as_chunks::<3>()
        .0
        .iter()
        .enumerate()
        .map(|(p, log)| grid.solid_angle(p / grid.width) * f64::from(luminance(log.map(f32::exp))))
        .collect();
    let facing = |way: [f32; 3]| -> f64 {
        let each = directions.iter().zip(&lit).map(|(d, lit)| {
            let cosine = dot(*d, way);
            lit * f64::from(cosine.max(0.0))
        });
        each.sum()
    };
    ways().into_iter().map(facing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::light::CompactLight;

    const GRID: Equirect = Equirect { width: 32, height: 16 };

    fn sky() -> Vec<f32> {
        GRID.directions().iter().flat_map(|d| [d[2], 0.5 * d[2] + 0.1 * d[0], 0.8 * d[2]]).collect()
    }

    #[test]
    fn a_field_that_is_too_dark_is_brought_to_its_panorama_lights_or_not() {
        let dark: Vec<f32> = sky().iter().map(|v| v - 0.3).collect();
        let sun = CompactLight::new([0.6, 0.0, 0.8], [5.0, 4.0, 3.0], CompactLight::SUN_RADIUS);
        for lights in [Lights::default(), Lights::new(Some(sun), [])] {
            let change = lit_exposure(GRID, &sky(), &dark, &lights);
            assert!((change - 0.3).abs() < 1e-5, "{change}");
            assert_eq!(lit_exposure(GRID, &sky(), &sky(), &lights), 0.0);
        }
    }

    #[test]
    fn a_smooth_field_of_a_speckled_panorama_gets_the_mean_not_the_mean_logarithm() {
        // every other pixel e² as bright: the mean of the logarithm is 1, the logarithm of the mean ln((1 + e²)/2)
        let speckled: Vec<f32> =
            (0..GRID.len()).flat_map(|p| [if p % 2 == 0 { 0.0 } else { 2.0 }; 3]).collect();
        let smooth = vec![1.0; 3 * GRID.len()];
        let change = lit_exposure(GRID, &speckled, &smooth, &Lights::default());
        let expected = ((1.0 + 2.0f32.exp()) / 2.0).ln() - 1.0;
        assert!((change - expected).abs() < 2e-3, "{change} instead of {expected}");
        // and no more than it may
        let far = vec![9.0; 3 * GRID.len()];
        assert_eq!(lit_exposure(GRID, &speckled, &far, &Lights::default()), -2.0);
    }
}
