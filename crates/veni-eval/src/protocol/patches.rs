//! Sliced Wasserstein distance between sets of image patches (Rabin et al. 2011; of patches, Karras et al. 2018).

use veni_light::random::{Purpose, Stream, stream};
use veni_light::sphere::Equirect;

/// Rows and columns of a patch.
pub(super) const PATCH: usize = 8;
/// Numbers of a patch.
const SIZE: usize = 3 * PATCH * PATCH;
/// Patches of a set.
const COUNT: usize = 4096;
/// Directions that sets are projected on.
const DIRECTIONS: usize = 128;
/// Places of the streams of random numbers.
const SLOTS: [u64; 2] = [78, 79];

/// Patches of images of log radiance: of any of them, anywhere; rows as often as the solid angle of their middle.
pub(super) fn patches(seed: u64, grid: Equirect, images: &[&[f32]]) -> Vec<[f32; SIZE]> {
    let mut rng = stream(seed, Purpose::Evaluation, 0, SLOTS[0]);
    (0..COUNT).map(|at| patch(grid, images[at % images.len()], &mut rng)).collect()
}

fn patch(grid: Equirect, image: &[f32], rng: &mut Stream) -> [f32; SIZE] {
    let rows = grid.height - PATCH;
    let most = grid.solid_angle(grid.height / 2);
    let top = loop {
        let top = rng.below(rows + 1);
        if rng.uniform() * most < grid.solid_angle(top + PATCH / 2) {
            break top;
        }
    };
    let left = rng.below(grid.width);
    std::array::from_fn(|k| {
        let (row, column, channel) = (top + k / (3 * PATCH), left + k / 3 % PATCH, k % 3);
        image[3 * (row * grid.width + column % grid.width) + channel]
    })
}

/// The mean over random directions of the Wasserstein distance between projections, per coordinate: of patches that differ by
/// one constant it is the mean of |⟨1, u⟩| times that over unit vectors u.
pub(super) fn distance(seed: u64, a: &[[f32; SIZE]], b: &[[f32; SIZE]]) -> f64 {
    let mut rng = stream(seed, Purpose::Evaluation, 1, SLOTS[1]);
    let one = |rng: &mut Stream| {
        let direction: Vec<f64> = (0..SIZE / 2).flat_map(|_| rng.normals()).collect();
        let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        let project = |all: &[[f32; SIZE]]| {
            let dot = |patch: &[f32; SIZE]| {
                patch.iter().zip(&direction).map(|(p, u)| f64::from(*p) * u).sum::<f64>()
            };
            let mut values: Vec<f64> = all.iter().map(|patch| dot(patch) / length).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let (a, b) = (project(a), project(b));
        a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len() as f64
    };
    (0..DIRECTIONS).map(|_| one(&mut rng)).sum::<f64>() / DIRECTIONS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_between_sets_is_their_distance() {
        let grid = Equirect::new(64, 32);
        let image: Vec<f32> = (0..3 * grid.len()).map(|k| (k as f32 * 0.37).sin()).collect();
        let bright: Vec<f32> = image.iter().map(|v| v + 1.0).collect();
        let (a, b) = (patches(1, grid, &[&image]), patches(1, grid, &[&bright]));
        assert_eq!(distance(3, &a, &a), 0.0);
        // E|⟨1, u⟩| of a unit vector in n dimensions times √n is √(2/π)
        let expected = std::f64::consts::FRAC_2_PI.sqrt();
        let found = distance(3, &a, &b);
        assert!((found / expected - 1.0).abs() < 0.15, "{found} {expected}");
    }
}
