//! Augmentations that add light of their own: spherical Gaussians where no panorama has any.

use rand::Rng;

use crate::data::random::{normal, uniform};
use crate::sphere::Equirect;

/// Narrowest and widest lobe, radians.
const WIDTHS: [f64; 2] = [0.05, 1.0];

/// A spherical Gaussian a·exp((⟨d, axis⟩ − 1)/σ²), one amplitude per channel.
#[derive(Clone, Copy, Debug)]
pub struct Lobe {
    /// Where it is highest, a unit vector.
    pub axis: [f64; 3],
    /// σ, radians.
    pub width: f64,
    /// a, natural-log units of radiance.
    pub amplitude: [f64; 3],
}

impl Lobe {
    /// Adds the lobe to log radiance.
    pub fn add(&self, grid: Equirect, image: &mut [f32]) {
        let sharpness = self.width.powi(-2);
        let [x, y, z] = self.axis;
        let horizontal: Vec<_> = (0..grid.width)
            .map(|i| {
                let (sin, cos) = grid.azimuth(i).sin_cos();
                x * cos + y * sin
            })
            .collect();
        for (j, row) in image.chunks_exact_mut(3 * grid.width).enumerate() {
            let (sin, cos) = grid.polar(j).sin_cos();
            for (pixel, h) in row.chunks_exact_mut(3).zip(&horizontal) {
                let exponent = sharpness * (sin * h + cos * z - 1.0);
                if exponent > -12.0 {
                    let shape = exponent.exp();
                    pixel.iter_mut().zip(self.amplitude).for_each(|(v, a)| *v += (a * shape) as f32);
                }
            }
        }
    }

    /// One of either sign: direction uniform over the sphere, width log-uniform, amplitude normal with deviation `sd` and a
    /// fifth of it again per channel.
    pub fn random(sd: f64, rng: &mut impl Rng) -> Self {
        let axis = direction(rng, -1.0);
        let width = WIDTHS[0] * (WIDTHS[1] / WIDTHS[0]).powf(uniform(rng));
        let common = sd * normal(rng);
        let amplitude = [0; 3].map(|_| common + 0.2 * sd * normal(rng));
        Self { axis, width, amplitude }
    }
}

/// A sun that no photograph has there: a core of 3° to 6° and e² to e⁶ above what is behind it, in a glow of 10° to 30°, anywhere
/// above −5°.
pub fn add_sun(grid: Equirect, image: &mut [f32], rng: &mut impl Rng) {
    let axis = direction(rng, -0.09);
    let grey = |a: f64| [a; 3];
    let core = Lobe { axis, width: 0.05 + 0.05 * uniform(rng), amplitude: grey(2.0 + 4.0 * uniform(rng)) };
    let glow = Lobe { axis, width: 0.17 + 0.35 * uniform(rng), amplitude: grey(1.5 * uniform(rng)) };
    core.add(grid, image);
    glow.add(grid, image);
}

/// Uniform over the part of the sphere with z ≥ `lowest`.
fn direction(rng: &mut impl Rng, lowest: f64) -> [f64; 3] {
    let z = lowest + (1.0 - lowest) * uniform(rng);
    let (sin, cos) = (std::f64::consts::TAU * uniform(rng)).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    [r * cos, r * sin, z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::random::{Purpose, stream};

    const GRID: Equirect = Equirect { width: 64, height: 32 };

    fn brightest(image: &[f32]) -> ([f64; 3], f32) {
        let (at, value) =
            (0..GRID.len()).map(|p| (p, image[3 * p])).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        (GRID.direction(at % GRID.width, at / GRID.width).map(f64::from), value)
    }

    /// The integral of exp((⟨d, a⟩ − 1)/σ²) over the sphere is 2πσ² (1 − exp(−2/σ²)), wherever a points.
    #[test]
    fn a_lobe_is_where_it_points_and_has_its_integral() {
        let mut rng = stream(3, Purpose::Fit, 0, 0);
        for _ in 0..20 {
            let mut lobe = Lobe::random(1.0, &mut rng);
            lobe.width = lobe.width.max(0.3);
            lobe.amplitude = [1.5, -0.5, 0.0];
            let mut image = vec![0.25; 3 * GRID.len()];
            lobe.add(GRID, &mut image);
            let (axis, peak) = brightest(&image);
            let cosine: f64 = axis.iter().zip(lobe.axis).map(|(a, b)| a * b).sum();
            assert!(cosine > 0.99 && (1.5..1.7501).contains(&peak), "{lobe:?}: {cosine} {peak}");

            let sum = |c: usize| -> f64 {
                image
                    .iter()
                    .skip(c)
                    .step_by(3)
                    .enumerate()
                    .map(|(p, v)| f64::from(*v - 0.25) * GRID.solid_angle(p / GRID.width))
                    .sum()
            };
            let square = lobe.width.powi(2);
            let expected = std::f64::consts::TAU * square * (1.0 - (-2.0 / square).exp());
            assert!((sum(0) - 1.5 * expected).abs() < 0.02 * expected, "{lobe:?}: {} of {expected}", sum(0));
            assert!((sum(1) + 0.5 * expected).abs() < 0.02 * expected && sum(2).abs() < 1e-6);
        }
    }

    #[test]
    fn a_sun_is_the_brightest_light_and_stands_above_the_ground() {
        let mut rng = stream(4, Purpose::Fit, 0, 0);
        for _ in 0..50 {
            let mut image = vec![0.0; 3 * GRID.len()];
            add_sun(GRID, &mut image, &mut rng);
            let (axis, peak) = brightest(&image);
            assert!(axis[2] > -0.2 && (1.0..7.6).contains(&peak), "{axis:?} {peak}");
            assert!(image.iter().all(|v| v.is_finite() && *v >= 0.0));
        }
    }
}
