//! What one step of an auto-decoder works on: rays of some panoramas.

use crate::train::config::TrainConfig;
use crate::train::draws::Draws;
use veni_data::Dataset;
use veni_light::random::{Purpose, stream};

/// The numbers of one step, row-major, channels last.
#[derive(Clone, Debug, PartialEq)]
pub struct RayBatch {
    /// Number of the update, from 1.
    pub step: u64,
    /// The batch's panoramas by their index in the training set, B of them; one may come twice.
    pub panoramas: Vec<usize>,
    /// R, rays of each.
    pub rays: usize,
    /// Unit directions [B, R, 3], each panorama's own.
    pub directions: Vec<f32>,
    /// Log radiance there [B, R, 3].
    pub target: Vec<f32>,
    /// ε of the variational sample [B, N, 3].
    pub noise: Vec<f32>,
}

/// Prepares batches. A batch is a pure function of the configuration and its step.
///
/// A ray is the centre of a pixel; rows are drawn by solid angle (∝ sin θ) and columns evenly, with replacement, so
/// that a plain mean over the rays estimates the mean over the sphere.
#[derive(Debug)]
pub struct RayBatches<'a> {
    train: &'a Dataset,
    draws: Draws,
    seed: u64,
    batch: usize,
    rays: usize,
    latent_vectors: usize,
    /// Share of the sphere above the lower edge of each row.
    cumulated: Vec<f64>,
}

impl<'a> RayBatches<'a> {
    /// Batches of `train`, `rays` to a step in all, otherwise as `config` says.
    pub fn new(config: &TrainConfig, rays: usize, train: &'a Dataset) -> Self {
        let grid = train.grid();
        let row = |j| grid.solid_angle(j) * grid.width as f64;
        let whole: f64 = (0..grid.height).map(row).sum();
        let cumulated = (0..grid.height).scan(0.0, |sum, j| {
            *sum += row(j) / whole;
            Some(*sum)
        });
        Self {
            train,
            draws: Draws::new(config, train),
            seed: config.seed,
            batch: config.batch,
            rays: rays / config.batch,
            latent_vectors: config.model.latent_vectors,
            cumulated: cumulated.collect(),
        }
    }

    /// The batch of update `step` (from 1).
    pub fn prepare(&self, step: u64) -> RayBatch {
        let grid = self.train.grid();
        let count = 3 * self.batch * self.rays;
        let mut batch = RayBatch {
            step,
            panoramas: (0..self.batch).map(|slot| self.draws.choice(step, slot)).collect(),
            rays: self.rays,
            directions: Vec::with_capacity(count),
            target: Vec::with_capacity(count),
            noise: Vec::with_capacity(3 * self.batch * self.latent_vectors),
        };
        for (slot, panorama) in (0..).zip(&batch.panoramas) {
            let image = self.train.items()[*panorama].log_radiance.fetched();
            let mut rng = stream(self.seed, Purpose::Sampling, step, slot);
            for _ in 0..self.rays {
                let height = rng.uniform();
                let row = self.cumulated.partition_point(|share| *share <= height).min(grid.height - 1);
                let column = rng.below(grid.width);
                batch.directions.extend(grid.direction(column, row));
                batch.target.extend(&image[3 * (row * grid.width + column)..][..3]);
            }
            let mut noise = stream(self.seed, Purpose::Noise, step, slot);
            batch.noise.extend((0..3 * self.latent_vectors).map(|_| noise.normal() as f32));
        }
        batch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::presets::Preset;
    use veni_data::Item;
    use veni_light::sphere::Equirect;

    #[test]
    fn rays_see_their_own_pixels_and_rows_by_solid_angle() {
        let grid = Equirect::new(8, 4);
        // each pixel holds its index, each panorama its number in the third channel
        let item = |k: usize| Item {
            path: format!("{k}.exr").into(),
            log_radiance: (0..grid.len()).flat_map(|p| [p as f32, 0.0, k as f32]).collect(),
            log_exposure: 0.0,
            lights: veni_light::light::Lights::default(),
            generated: false,
        };
        let train = Dataset::new(grid, (0..3).map(item).collect());
        let config = Preset::Tiny.auto_decoder(3);
        let batches = RayBatches::new(&config, 4000, &train);
        let batch = batches.prepare(5);
        assert_eq!(batch, batches.prepare(5));
        assert_ne!(batch.directions, batches.prepare(6).directions);
        assert_eq!((batch.panoramas.len(), batch.rays, batch.noise.len()), (2, 2000, 18));
        let mut rows = [0.0; 4];
        let pairs = batch.target.as_chunks::<3>().0.iter().zip(batch.directions.as_chunks::<3>().0);
        for (i, (pixel, direction)) in pairs.enumerate() {
            let index = pixel[0] as usize;
            assert_eq!(*direction, grid.direction(index % 8, index / 8));
            assert_eq!(pixel[2] as usize, batch.panoramas[i / 2000]);
            rows[index / 8] += 1.0 / 4000.0;
        }
        for (j, share) in rows.into_iter().enumerate() {
            let expected = grid.solid_angle(j) * 8.0 / (4.0 * std::f64::consts::PI);
            // five standard errors
            assert!(
                (share - expected).abs() < 5.0 * (expected / 4000.0).sqrt(),
                "row {j}: {share} {expected}"
            );
        }
    }
}
