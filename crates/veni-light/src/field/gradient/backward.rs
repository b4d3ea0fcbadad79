//! One task: its directions in blocks, each forward with its activations kept, then backward. MODEL (39).

use pulp::{Simd, WithSimd};

use super::operations::{accumulate, accumulate_product, accumulate_products};
use super::outer;
use super::pass::{BackwardVisitor, Pass, Tape, flat, flat_mut, lane_sum};
use super::weight_sums::{WeightSums, WeightWorkspace, vector};
use crate::field::Folded;
use crate::field::aligned::Aligned;
use crate::field::block::{Row, VECTORS};
use crate::field::mlp::Mlp;

/// ℓ and its derivatives with respect to log radiance, given the direction's index and log radiance.
pub(super) type PixelLoss<'a> = dyn Fn(usize, [f32; 3]) -> (f64, [f32; 3]) + Sync + 'a;

/// Gradients with respect to what conditioning leaves of a latent, summed over directions.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    pub(super) loss: f64,
    pub(super) log_exposure: f64,
    /// By x and y of the latent vectors, through the directional input only.
    pub(super) vectors: Vec<[f64; 2]>,
    /// By what is added before the first layer, then after each: the vectors of [`Folded`], [1 + layers, h].
    pub(super) added: Vec<f64>,
}

impl Sums {
    pub(super) fn new(mlp: &Mlp, latent_vectors: usize) -> Self {
        Self {
            loss: 0.0,
            log_exposure: 0.0,
            vectors: vec![[0.0; 2]; latent_vectors],
            added: vec![0.0; (1 + mlp.layers.len()) * mlp.hidden],
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.loss += other.loss;
        self.log_exposure += other.log_exposure;
        let pairs = self.vectors.as_flattened_mut().iter_mut().zip(other.vectors.as_flattened());
        let all = pairs.chain(self.added.iter_mut().zip(&other.added));
        for (sum, value) in all {
            *sum += value;
        }
    }
}

/// Work for one thread: any number of directions.
pub(super) struct Backward<'a> {
    pub(super) mlp: &'a Mlp,
    pub(super) folded: &'a Folded,
    pub(super) directions: &'a [[f32; 3]],
    pub(super) loss: &'a PixelLoss<'a>,
    pub(super) sums: &'a mut Sums,
    /// Where the gradients with respect to the weights are added, if they are wanted.
    pub(super) weights: Option<&'a mut WeightSums>,
    pub(super) scratch: &'a mut Aligned,
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { mlp, folded, directions, loss, sums, weights, scratch } = self;
        let (lanes, added) = (outer::lanes::<S>(), (1 + mlp.layers.len()) * mlp.hidden);
        let sum_rows = (added + 2 * folded.vectors.len()).div_ceil(VECTORS);
        let rows = Pass::<S>::rows(mlp) + sum_rows;
        let workspace = if weights.is_some() { WeightWorkspace::<S>::vectors(mlp) } else { 0 };
        let scratch = scratch.at_least(lanes * rows + S::F32_LANES * workspace);
        let (all, workspace) = S::as_mut_simd_f32s(scratch).0.split_at_mut(VECTORS * rows);
        let (mut pass, rest) = Pass::new(simd, mlp, folded, all.as_chunks_mut::<VECTORS>().0);
        let rest = rest.as_flattened_mut();
        rest.fill(simd.splat_f32s(0.0));
        let (added, vectors) = rest.split_at_mut(added);
        let (vectors, _) = vectors.as_chunks_mut::<2>();
        let (weights, workspace) = match weights {
            Some(weights) => (Some(weights), Some(WeightWorkspace::new(simd, mlp, workspace))),
            None => (None, None),
        };
        let mut lane_sums = LaneSums { mlp, added, vectors, workspace };

        for (b, directions) in directions.chunks(lanes).enumerate() {
            pass.forward(simd, directions);
            {
                let (rgb, adjoint) = (flat::<S>(pass.rgb), flat_mut::<S>(pass.adjoint));
                // idle lanes of a short block have no gradient
                adjoint.fill(0.0);
                for i in 0..directions.len() {
                    let p = [0, 1, 2].map(|c| rgb[c * lanes + i] + folded.log_exposure);
                    let (value, gradient) = loss(b * lanes + i, p);
                    sums.loss += value;
                    for (c, g) in gradient.into_iter().enumerate() {
                        sums.log_exposure += f64::from(g);
                        adjoint[c * lanes + i] = g;
                    }
                }
            }
            pass.backward(simd, &mut lane_sums);
        }
        let LaneSums { added, vectors, workspace, .. } = lane_sums;
        for (sum, vector) in sums.added.iter_mut().zip(added) {
            *sum += lane_sum::<S>(vector);
        }
        for (sum, vector) in sums.vectors.as_flattened_mut().iter_mut().zip(vectors.as_flattened()) {
            *sum += lane_sum::<S>(vector);
        }
        if let (Some(sums), Some(workspace)) = (weights, workspace) {
            workspace.drain(mlp, sums);
        }
    }
}

/// Sums over the directions of a task, lane by lane.
struct LaneSums<'a, S: Simd> {
    mlp: &'a Mlp,
    /// As [`Sums::added`].
    added: &'a mut [S::f32s],
    /// As [`Sums::vectors`].
    vectors: &'a mut [[S::f32s; 2]],
    /// By the weights, if they are wanted.
    workspace: Option<WeightWorkspace<'a, S>>,
}

impl<S: Simd> BackwardVisitor<S> for LaneSums<'_, S> {
    #[inline(always)]
    fn added(&mut self, simd: S, at: usize, gradient: &[Row<S>]) {
        accumulate(simd, gradient, &mut self.added[at * gradient.len()..][..gradient.len()]);
    }

    #[inline(always)]
    fn product(&mut self, simd: S, j: usize, _v: usize, gradient: S::f32s, direction: [S::f32s; 2]) {
        let [x, y] = &mut self.vectors[j];
        *x = simd.mul_add_e_f32s(gradient, direction[0], *x);
        *y = simd.mul_add_e_f32s(gradient, direction[1], *y);
    }

    #[inline(always)]
    fn output(&mut self, simd: S, x: &[Row<S>], gradient: &[Row<S>]) {
        let Some(workspace) = &mut self.workspace else { return };
        for (gradient, sums) in gradient.iter().zip(workspace.output.chunks_exact_mut(x.len())) {
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum = accumulate_product(simd, *sum, x, gradient);
            }
        }
        accumulate(simd, &gradient[..3], workspace.output_bias);
    }

    #[inline(always)]
    fn second_norm(&mut self, simd: S, l: usize, gradient: &[Row<S>], standard: &[Row<S>]) {
        let Some(workspace) = &mut self.workspace else { return };
        accumulate_products(simd, gradient, standard, workspace.layers[l].vectors[vector::GAMMA2]);
    }

    #[inline(always)]
    fn feed_forward(&mut self, simd: S, l: usize, tape: &Tape<'_, S>, [by1, by2]: [&[Row<S>]; 2]) {
        let Some(workspace) = &mut self.workspace else { return };
        workspace.add_ff2(simd, l, &tape.units[..by2.len()], by2);
        workspace.add_ff1(simd, l, &tape.first[..by1.len()], by1);
        let sums = &mut workspace.layers[l].vectors;
        accumulate(simd, by2, sums[vector::FF2_BIAS]);
        accumulate(simd, by1, sums[vector::FF1_BIAS]);
    }

    #[inline(always)]
    fn first_norm(&mut self, simd: S, l: usize, gradient: &[Row<S>], standard: &[Row<S>]) {
        let Some(workspace) = &mut self.workspace else { return };
        accumulate(simd, gradient, workspace.layers[l].vectors[vector::BETA1]);
        accumulate_products(simd, gradient, standard, workspace.layers[l].vectors[vector::GAMMA1]);
    }

    #[inline(always)]
    fn input(&mut self, simd: S, features: &[Row<S>], gradient: &[Row<S>]) {
        if let Some(workspace) = &mut self.workspace {
            workspace.add_input(simd, self.mlp, features, gradient);
        }
    }
}
