//! The normal equations of Gauss and Newton: how a loss on log radiance curves with the latent, seen through the
//! decoder's own derivatives. MODEL (41).
//!
//! Every direction goes forward once and backward three times, once for each colour. That leaves the rows of the
//! Jacobian J = ∂(log radiance)/∂(latent) lane by lane, and their products Jᵀ diag(ℓ″) J and Jᵀ ℓ′ are summed
//! while they are there: no Jacobian is ever kept.

use pulp::{Simd, WithSimd};

use super::block_equations::BlockEquations;
use super::in_tasks;
use super::jacobian::{Chain, Rows};
use super::lobes::LobeRows;
use super::outer::{self, Wide};
use super::pass::{Pass, lane_sum};
use crate::field::aligned::Aligned;
use crate::field::block::VECTORS;
use crate::field::mlp::Mlp;
use crate::field::{Field, Folded};
use crate::latent::Lobe;

/// Fewest directions of a task, and about how many tasks: each has a matrix of its own.
const TASK: usize = 96;
const TASKS: usize = 16;

/// The local quadratic of a direction's loss around a log radiance, channel by channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalQuadratic {
    /// ℓ.
    pub loss: f64,
    /// ∂ℓ/∂p.
    pub gradient: [f32; 3],
    /// The Gauss–Newton weight: what stands for ∂²ℓ/∂p², at least 0; of a squared error w (p − t)² it is 2w.
    pub weight: [f32; 3],
}

/// Σᵢ ℓᵢ and its model ℓ + gᵀδ + ½ δᵀHδ for a small change δ of the latent: x, y, z of the N vectors one after the
/// other, then the log exposure, 3N + 1 coordinates; then, where they were asked for, [`Lobe::COORDINATES`] of each lobe.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalEquations {
    /// Σᵢ ℓᵢ.
    pub loss: f64,
    /// g, as [`Field::gradient`] gives it.
    pub gradient: Vec<f64>,
    /// H = Σᵢ Jᵢᵀ diag(ℓᵢ″) Jᵢ, row-major: symmetric and positive semidefinite. The decoder's own second derivatives
    /// are left out.
    pub matrix: Vec<f64>,
}

impl Field {
    /// The normal equations of Σᵢ ℓᵢ at the latent. `loss(i, p)` gets the log radiance p (r, g, b, exposure included)
    /// in direction i.
    ///
    /// Costs about the multiply-adds of `4 + N/35` calls of [`Field::log_radiance_batch`], on all cores, and 16
    /// matrices of memory whatever the number of directions. The same bits for any number of threads.
    pub fn normal_equations(
        &self,
        directions: &[[f32; 3]],
        loss: impl Fn(usize, [f32; 3]) -> LocalQuadratic + Sync,
    ) -> NormalEquations {
        self.equations(directions, &[], loss)
    }

    /// The same with the coordinates of the code's lobes as unknowns too: the change of each lobe, as
    /// [`Lobe::moved`](crate::latent::Lobe::moved) takes it, follows the log exposure.
    ///
    /// Costs 3 (3N + 1 + 6K)² multiply-adds more a direction.
    pub fn normal_equations_with_lobes(
        &self,
        directions: &[[f32; 3]],
        loss: impl Fn(usize, [f32; 3]) -> LocalQuadratic + Sync,
    ) -> NormalEquations {
        self.equations(directions, &LobeRows::of(&self.folded.lobes), loss)
    }

    fn equations(
        &self,
        directions: &[[f32; 3]],
        lobes: &[LobeRows],
        loss: impl Fn(usize, [f32; 3]) -> LocalQuadratic + Sync,
    ) -> NormalEquations {
        let (weights, folded) = (&*self.weights, &*self.folded);
        let chain = Chain::new(weights, folded);
        let unknowns = 3 * weights.latent_vectors + 1 + Lobe::COORDINATES * lobes.len();
        let parts = in_tasks(directions, TASK, TASKS, |scratch, first, directions| {
            let mut sums = NormalEquations::zero(unknowns);
            pulp::Arch::new().dispatch(Normal {
                mlp: &weights.mlp,
                folded,
                chain: &chain,
                lobes,
                directions,
                loss: &|i, p| loss(first + i, p),
                sums: &mut sums,
                scratch,
            });
            sums
        });
        let mut total = NormalEquations::zero(unknowns);
        parts.iter().for_each(|part| total.add(part));
        total
    }
}

impl NormalEquations {
    pub(super) fn zero(unknowns: usize) -> Self {
        Self { loss: 0.0, gradient: vec![0.0; unknowns], matrix: vec![0.0; unknowns * unknowns] }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.loss += other.loss;
        let pairs = self.gradient.iter_mut().zip(&other.gradient);
        for (sum, value) in pairs.chain(self.matrix.iter_mut().zip(&other.matrix)) {
            *sum += value;
        }
    }
}

/// A loss by direction and log radiance.
pub(super) type QuadraticLoss<'a> = dyn Fn(usize, [f32; 3]) -> LocalQuadratic + Sync + 'a;

/// Work for one thread: any number of directions.
struct Normal<'a> {
    mlp: &'a Mlp,
    folded: &'a Folded,
    chain: &'a Chain<'a>,
    lobes: &'a [LobeRows],
    directions: &'a [[f32; 3]],
    loss: &'a QuadraticLoss<'a>,
    sums: &'a mut NormalEquations,
    scratch: &'a mut Aligned,
}

impl WithSimd for Normal<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { mlp, folded, chain, lobes, directions, loss, sums, scratch } = self;
        let (lanes, unknowns) = (outer::lanes::<S>(), sums.gradient.len());
        let panels = outer::panels::<S>(unknowns);
        let wide = size_of::<Wide<S>>() / size_of::<S::f32s>();
        let rows = Pass::<S>::rows(mlp) + BlockEquations::<S>::rows(unknowns) + unknowns + chain.padded();
        let vectors = wide * panels * (lanes + unknowns) + unknowns;
        let scratch = scratch.at_least(lanes * rows + S::F32_LANES * vectors);
        let (all, workspace) = S::as_mut_simd_f32s(scratch).0.split_at_mut(VECTORS * rows);
        let (mut pass, rest) = Pass::new(simd, mlp, folded, all.as_chunks_mut::<VECTORS>().0);
        workspace[..vectors].fill(simd.splat_f32s(0.0));
        let (transposed, workspace) = workspace.split_at_mut(wide * panels * lanes);
        let (matrix, workspace) = workspace.split_at_mut(wide * panels * unknowns);
        let matrix = matrix.as_chunks_mut().0;
        let gradient = &mut workspace[..unknowns];
        let (mut block, rest) = BlockEquations::new(unknowns, rest, transposed.as_chunks_mut().0);
        let (jacobian, polar) = rest.split_at_mut(unknowns);
        let mut rows = Rows::new(simd, chain, lobes, jacobian, polar);

        for (b, directions) in directions.chunks(lanes).enumerate() {
            pass.forward(simd, directions);
            let (first, count) = (b * lanes, directions.len());
            block.ask(loss, first, count, pass.rgb, folded.log_exposure, &mut sums.loss);
            for c in 0..3 {
                block.add(simd, c, rows.of_colour(simd, &mut pass, c), gradient, matrix);
            }
        }
        for (sum, vector) in sums.gradient.iter_mut().zip(gradient) {
            *sum += lane_sum::<S>(vector);
        }
        let mut row = vec![0.0; unknowns];
        for (k, sums) in sums.matrix.chunks_exact_mut(unknowns).enumerate() {
            row.fill(0.0);
            outer::read::<S>(matrix, unknowns, k, &mut row);
            sums.iter_mut().zip(&row).for_each(|(sum, value)| *sum += f64::from(*value));
        }
    }
}
