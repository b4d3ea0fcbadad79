//! Weighted sums of radiance over directions, and their Jacobian by the latent: what harmonics, irradiance and every other
//! linear functional of light are. LIGHT (16).
//!
//! As for the normal equations, a block of directions goes forward once and backward once per colour; the rows of the
//! Jacobian of log radiance are multiplied by radiance and by every weight while they are in the cache. A hundred sums
//! cost little more than one.

use pulp::{Simd, WithSimd};

use super::in_tasks;
use super::jacobian::{Chain, Rows};
use super::operations::accumulate_product;
use super::outer;
use super::pass::{Pass, flat, flat_mut, lane_sum};
use crate::field::aligned::Aligned;
use crate::field::block::VECTORS;
use crate::field::mlp::Mlp;
use crate::field::{Field, Folded};

/// Fewest directions of a task, and about how many tasks: each has a Jacobian of its own.
const TASK: usize = 96;
const TASKS: usize = 16;

/// M_jc = Σᵢ w_ij L_c(dᵢ): sums of linear radiance L (exposure included) over directions dᵢ, weighted by numbers w_ij.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    /// M, R, G and B, for every column j of the weights.
    pub values: Vec<[f64; 3]>,
    /// ∂M_jc/∂(latent) at row 3 j + c, row-major: x, y, z of the N vectors one after the other, then the log exposure;
    /// 3N + 1 columns. The last one is M itself.
    pub jacobian: Vec<f64>,
}

impl Field {
    /// The moments of the field. `weights` are row-major, a row for each of the unit `directions`, of `count` numbers each:
    /// for an integral over the sphere, a function of the direction times the solid angle that the direction stands for.
    ///
    /// Costs about the multiply-adds of four calls of [`Field::radiance_batch`], on all cores, and `count` · 3 (3N + 1) a
    /// direction. The same bits for any number of threads.
    ///
    /// # Panics
    /// If there are not `count` weights for every direction.
    pub fn moments(&self, directions: &[[f32; 3]], weights: &[f32], count: usize) -> Moments {
        let (n, m) = (directions.len() * count, weights.len());
        assert!(n == m, "{} directions need {n} weights, not {m}", directions.len());
        let (mlp, folded) = (&self.weights.mlp, &*self.folded);
        let chain = Chain::new(&self.weights, folded);
        let unknowns = 3 * self.weights.latent_vectors + 1;
        let parts = in_tasks(directions, TASK, TASKS, |scratch, first, directions| {
            let mut sums = Moments::zero(count, unknowns);
            let weights = &weights[first * count..][..directions.len() * count];
            pulp::Arch::new().dispatch(Sum {
                mlp,
                folded,
                chain: &chain,
                directions,
                weights,
                sums: &mut sums,
                scratch,
            });
            sums
        });
        let mut total = Moments::zero(count, unknowns);
        parts.iter().for_each(|part| total.add(part));
        total
    }
}

impl Moments {
    fn zero(count: usize, unknowns: usize) -> Self {
        Self { values: vec![[0.0; 3]; count], jacobian: vec![0.0; 3 * count * unknowns] }
    }

    fn add(&mut self, other: &Self) {
        let values = self.values.as_flattened_mut().iter_mut().zip(other.values.as_flattened());
        for (sum, value) in values.chain(self.jacobian.iter_mut().zip(&other.jacobian)) {
            *sum += value;
        }
    }
}

/// Work for one thread: any number of directions.
struct Sum<'a> {
    mlp: &'a Mlp,
    folded: &'a Folded,
    chain: &'a Chain<'a>,
    directions: &'a [[f32; 3]],
    weights: &'a [f32],
    sums: &'a mut Moments,
    scratch: &'a mut Aligned,
}

impl WithSimd for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { mlp, folded, chain, directions, weights, sums, scratch } = self;
        let (lanes, count) = (outer::lanes::<S>(), sums.values.len());
        if count == 0 {
            return;
        }
        let unknowns = sums.jacobian.len() / (3 * count);
        let rows = Pass::<S>::rows(mlp) + count + unknowns + chain.padded();
        let scratch = scratch.at_least(lanes * rows + S::F32_LANES * sums.jacobian.len());
        let (all, jacobian_sums) = S::as_mut_simd_f32s(scratch).0.split_at_mut(VECTORS * rows);
        let (mut pass, rest) = Pass::new(simd, mlp, folded, all.as_chunks_mut::<VECTORS>().0);
        let (light, rest) = rest.split_at_mut(count);
        let (jacobian, polar) = rest.split_at_mut(unknowns);
        let jacobian_sums = &mut jacobian_sums[..sums.jacobian.len()];
        jacobian_sums.fill(simd.splat_f32s(0.0));
        let mut rows = Rows::new(simd, chain, &[], jacobian, polar);

        for (directions, weights) in directions.chunks(lanes).zip(weights.chunks(lanes * count)) {
            pass.forward(simd, directions);
            for c in 0..3 {
                {
                    let (rgb, light) = (flat::<S>(pass.rgb), flat_mut::<S>(light));
                    // idle lanes of a short block count nothing
                    light.fill(0.0);
                    for (i, weights) in weights.chunks_exact(count).enumerate() {
                        let radiance = f64::from(rgb[c * lanes + i] + folded.log_exposure).exp();
                        for (j, weight) in weights.iter().enumerate() {
                            let part = f64::from(*weight) * radiance;
                            sums.values[j][c] += part;
                            light[j * lanes + i] = part as f32;
                        }
                    }
                }
                let jacobian = rows.of_colour(simd, &mut pass, c);
                for (j, light) in light.iter().enumerate() {
                    let sums = &mut jacobian_sums[(3 * j + c) * unknowns..][..unknowns];
                    for (sum, row) in sums.iter_mut().zip(jacobian) {
                        *sum = accumulate_product(simd, *sum, row, light);
                    }
                }
            }
        }
        for (sum, vector) in sums.jacobian.iter_mut().zip(jacobian_sums) {
            *sum += lane_sum::<S>(vector);
        }
    }
}
