//! What one step works on, prepared on the host while the previous step computes.

use crate::train::config::{LossGrid, TrainConfig};
use crate::train::draws::Draws;
use veni_data::coarsen::averaged;
use veni_data::{AugmentConfig, Dataset};
use veni_light::random::{Purpose, Stream, stream};
use veni_light::sphere::{Equirect, Stripes};

/// The numbers of one step, row-major, channels last.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// Number of the update, from 1.
    pub step: u64,
    /// B, panoramas.
    pub images: usize,
    /// Directions of the encoder's samples [B, T, P, 3]; each panorama has its own yaw.
    pub stripe_directions: Vec<f32>,
    /// Log radiance there [B, T, P, 3].
    pub stripe_samples: Vec<f32>,
    /// Rows and columns of the loss grid.
    pub loss_size: [usize; 2],
    /// Directions of the loss grid [R, 3], R rows × columns, shared by all panoramas.
    pub loss_directions: Vec<f32>,
    /// Target log radiance [B, rows, columns, 3].
    pub target: Vec<f32>,
    /// ε of the variational sample [B, N, 3].
    pub noise: Vec<f32>,
}

impl Batch {
    /// The same panoramas in `parts` batches, whose sizes differ by one at most.
    ///
    /// # Panics
    /// If there are fewer panoramas than parts.
    pub fn split(&self, parts: usize) -> Vec<Self> {
        let images = self.images;
        assert!((1..=images).contains(&parts), "{images} panoramas in {parts} parts");
        let part = |values: &[f32], [from, to]: [usize; 2]| {
            let size = values.len() / images;
            values[from * size..to * size].to_vec()
        };
        (0..parts)
            .map(|at| [at * images / parts, (at + 1) * images / parts])
            .map(|range| Self {
                step: self.step,
                images: range[1] - range[0],
                stripe_directions: part(&self.stripe_directions, range),
                stripe_samples: part(&self.stripe_samples, range),
                loss_size: self.loss_size,
                loss_directions: self.loss_directions.clone(),
                target: part(&self.target, range),
                noise: part(&self.noise, range),
            })
            .collect()
    }
}

/// Prepares batches. A batch is a pure function of the configuration and its step.
#[derive(Debug)]
pub struct Batches<'a> {
    train: &'a Dataset,
    augment: AugmentConfig,
    draws: Draws,
    loss_grid: LossGrid,
    seed: u64,
    batch: usize,
    latent_vectors: usize,
    stripes: Stripes,
    directions: Vec<[f32; 3]>,
}

impl<'a> Batches<'a> {
    /// Batches of `train` as `config` says, sampled on `stripes`.
    pub fn new(config: &TrainConfig, stripes: Stripes, train: &'a Dataset) -> Self {
        Self {
            train,
            augment: config.augment.clone(),
            draws: Draws::new(config, train),
            loss_grid: config.loss_grid,
            seed: config.seed,
            batch: config.batch,
            latent_vectors: config.model.latent_vectors,
            directions: stripes.directions(),
            stripes,
        }
    }

    /// The batch of update `step` (from 1).
    pub fn prepare(&self, step: u64) -> Batch {
        let grid = self.train.grid();
        let loss = LossView::new(self.loss_grid, grid, &mut stream(self.seed, Purpose::Sampling, step, 0));
        let mut batch = Batch {
            step,
            images: self.batch,
            stripe_directions: Vec::new(),
            stripe_samples: Vec::new(),
            loss_size: loss.size(),
            loss_directions: loss.directions(),
            target: Vec::new(),
            noise: Vec::with_capacity(3 * self.batch * self.latent_vectors),
        };
        for slot in 0..self.batch {
            let image = self.augmented(self.draws.choice(step, slot), step, slot as u64);
            let yaw =
                std::f64::consts::TAU * stream(self.seed, Purpose::Sampling, step, 1 + slot as u64).uniform();
            // the grid is rotated, not the image: samples and directions lie at −yaw, in the image's own frame
            let samples = self.stripes.gather_rotated(grid, yaw).sample(image.as_chunks().0);
            batch.stripe_samples.extend(samples.into_flattened());
            let (sin, cos) = yaw.sin_cos();
            let rotated = |[x, y, z]: &[f32; 3]| {
                let (x, y) = (f64::from(*x), f64::from(*y));
                [(cos * x + sin * y) as f32, (cos * y - sin * x) as f32, *z]
            };
            batch.stripe_directions.extend(self.directions.iter().flat_map(rotated));
            loss.extend_target(&image, &mut batch.target);
            let mut noise = stream(self.seed, Purpose::Noise, step, slot as u64);
            batch.noise.extend((0..3 * self.latent_vectors).map(|_| noise.normal() as f32));
        }
        batch
    }

    /// Panorama `index` of the training set as slot `slot` of update `step` sees it.
    pub fn augmented(&self, index: usize, step: u64, slot: u64) -> Vec<f32> {
        let items = self.train.items();
        let mut rng = stream(self.seed, Purpose::Augment, step, slot);
        let image = items[index].log_radiance.fetched();
        self.augment.apply(self.train.grid(), image, &mut rng, |rng| {
            items[self.draws.partner(rng)].log_radiance.fetched()
        })
    }
}

/// The directions of one step's losses, and how to take a target on them.
struct LossView {
    grid: Equirect,
    kind: LossGrid,
    /// Row and column of the first pixel, for [`LossGrid::Strided`].
    offset: [usize; 2],
}

impl LossView {
    fn new(kind: LossGrid, grid: Equirect, rng: &mut Stream) -> Self {
        let offset = match kind {
            LossGrid::Strided { factor } => [rng.below(factor), rng.below(factor)],
            LossGrid::Full {} | LossGrid::Averaged { .. } => [0; 2],
        };
        Self { grid, kind, offset }
    }

    fn size(&self) -> [usize; 2] {
        [self.grid.height, self.grid.width].map(|n| n / self.kind.factor())
    }

    fn directions(&self) -> Vec<f32> {
        let [rows, columns] = self.size();
        match self.kind {
            LossGrid::Full {} | LossGrid::Averaged { .. } => {
                Equirect::new(columns, rows).directions().into_iter().flatten().collect()
            }
            LossGrid::Strided { factor } => (0..rows)
                .flat_map(|j| (0..columns).map(move |i| (j, i)))
                .flat_map(|(j, i)| {
                    self.grid.direction(self.offset[1] + i * factor, self.offset[0] + j * factor)
                })
                .collect(),
        }
    }

    fn extend_target(&self, image: &[f32], target: &mut Vec<f32>) {
        let ([rows, columns], width) = (self.size(), self.grid.width);
        match self.kind {
            LossGrid::Full {} => target.extend_from_slice(image),
            LossGrid::Strided { factor } => {
                for j in (0..rows).map(|j| self.offset[0] + j * factor) {
                    for i in (0..columns).map(|i| self.offset[1] + i * factor) {
                        target.extend_from_slice(&image[3 * (j * width + i)..][..3]);
                    }
                }
            }
            LossGrid::Averaged { factor } => target.extend(averaged(self.grid, image, factor)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Equirect = Equirect { width: 8, height: 4 };

    fn view(kind: LossGrid, step: u64) -> LossView {
        LossView::new(kind, GRID, &mut stream(3, Purpose::Sampling, step, 0))
    }

    /// Each pixel's value is a linear function of its index, so positions can be read off the target.
    fn ramp() -> Vec<f32> {
        (0..GRID.len()).flat_map(|p| [p as f32, p as f32 + 0.25, p as f32 + 0.5]).collect()
    }

    #[test]
    fn strided_targets_and_directions_belong_to_the_same_pixels() {
        let mut seen = std::collections::BTreeSet::new();
        for step in 0..40 {
            let view = view(LossGrid::Strided { factor: 2 }, step);
            let mut target = Vec::new();
            view.extend_target(&ramp(), &mut target);
            let directions = view.directions();
            assert_eq!((target.len(), directions.len()), (24, 24));
            for (pixel, direction) in target.chunks_exact(3).zip(directions.chunks_exact(3)) {
                let index = pixel[0] as usize;
                assert_eq!(direction, GRID.direction(index % 8, index / 8));
                seen.insert(index);
            }
        }
        assert_eq!(seen.len(), GRID.len(), "every pixel has its turn");
    }
}
