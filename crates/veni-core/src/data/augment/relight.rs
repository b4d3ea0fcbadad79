//! Augmentations that change a panorama's light where it is.

use rand::Rng;

use crate::data::random::{normal, signed, uniform};
use crate::sphere::Equirect;

/// Lobes that [`lobes`] adds.
const LOBES: usize = 4;
/// Range of their sharpness κ: the narrowest falls to 1/e at 29° from its centre.
const SHARPNESS: [f64; 2] = [1.0, 8.0];
/// A channel's own part of a lobe's height, beside the one that all have in common.
const COLOUR: f64 = 0.3;

/// Adds smooth random light: Σ_k a_k e^(κ_k (⟨d, μ_k⟩ − 1)) on log radiance, four lobes towards directions μ that are
/// uniform on the sphere, ln κ uniform, a normal with the standard deviation `height` and, for each channel, 0.3 of
/// it.
pub fn lobes(grid: Equirect, image: &mut [f32], height: f64, rng: &mut impl Rng) {
    for _ in 0..LOBES {
        let z = signed(rng);
        let azimuth = std::f64::consts::TAU * uniform(rng);
        let [low, high] = SHARPNESS.map(f64::ln);
        let kappa = (low + (high - low) * uniform(rng)).exp();
        let common = normal(rng);
        let heights = [0; 3].map(|_| (height * (common + COLOUR * normal(rng))) as f32);
        let across = (1.0 - z * z).sqrt();
        let cosines: Vec<_> = (0..grid.width).map(|i| (grid.azimuth(i) - azimuth).cos()).collect();
        for (j, row) in image.chunks_exact_mut(3 * grid.width).enumerate() {
            let (sin, cos) = grid.polar(j).sin_cos();
            for (pixel, cosine) in row.chunks_exact_mut(3).zip(&cosines) {
                let lobe = (kappa * (across * sin * cosine + z * cos - 1.0)).exp() as f32;
                pixel.iter_mut().zip(heights).for_each(|(v, height)| *v += height * lobe);
            }
        }
    }
}

/// Adds a gain to each channel.
pub fn add_per_channel(image: &mut [f32], gains: [f32; 3]) {
    for pixel in image.chunks_exact_mut(3) {
        pixel.iter_mut().zip(gains).for_each(|(v, g)| *v += g);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::random::{Purpose, stream};

    #[test]
    fn lobes_are_smooth_all_over_the_sphere_and_of_the_height_asked_for() {
        let grid = Equirect::new(64, 32);
        let draws = 400;
        let (mut highest, mut step, mut difference) = (0.0, 0.0_f32, 0.0);
        for slot in 0..draws {
            let mut image = vec![0.0; 3 * grid.len()];
            lobes(grid, &mut image, 0.5, &mut stream(1, Purpose::Augment, 0, slot));
            let at = |i: usize, j: usize| image[3 * (j * grid.width + i % grid.width)];
            for j in 0..grid.height {
                // the seam is a neighbour like any other
                step = (0..grid.width).map(|i| (at(i + 1, j) - at(i, j)).abs()).fold(step, f32::max);
            }
            // around the pole all azimuths look the same way
            step = (0..grid.width).map(|i| (at(i, 0) - at(0, 0)).abs()).fold(step, f32::max);
            let largest = image.iter().fold(0.0_f32, |most, v| most.max(v.abs()));
            highest += f64::from(largest) / f64::from(draws as u32);
            let colour = image.chunks_exact(3).map(|p| (p[0] - p[2]).abs()).fold(0.0, f32::max);
            difference += f64::from(colour) / f64::from(draws as u32);
        }
        // the largest of four normal heights has a mean near 0.73; lobes overlap
        assert!((0.5..1.1).contains(&highest), "{highest}");
        assert!((0.1..0.5).contains(&difference), "{difference}");
        assert!(step < 0.4, "{step}");
    }
}
