//! The normal equations of lobes alone, over a log radiance that stays as it is: no network is evaluated. MODEL (82).
//!
//! Of one colour's log radiance a lobe's other two amplitudes say nothing, so that each colour has a matrix of four rows a lobe.

use pulp::{Simd, WithSimd};

use super::block_equations::BlockEquations;
use super::in_tasks;
use super::lobes::LobeRows;
use super::normal::{LocalQuadratic, NormalEquations, QuadraticLoss};
use super::outer::{self, Wide};
use super::pass::{flat_mut, lane_sum};
use crate::field::aligned::Aligned;
use crate::field::block::{Row, VECTORS};
use crate::latent::Lobe;

/// Fewest directions of a task, and about how many tasks: each has three matrices of its own.
const TASK: usize = 192;
const TASKS: usize = 16;

impl NormalEquations {
    /// Those of Σᵢ ℓᵢ in the coordinates of `lobes`, [`Lobe::COORDINATES`] of each, which are added to `base`, a log radiance (r, g,
    /// b) for each of the unit `directions`. `loss(i, p)` gets the log radiance p, lobes included, in direction i.
    ///
    /// As [`Field::normal_equations_with_lobes`](crate::field::Field::normal_equations_with_lobes) without the latent and the
    /// exposure, and but for rounding its last rows; costs 3 (4K)² multiply-adds a direction, on all cores. The same bits for any
    /// number of threads.
    ///
    /// # Panics
    /// Panics if `base` and `directions` differ in length.
    pub fn of_lobes(
        lobes: &[Lobe],
        base: &[[f32; 3]],
        directions: &[[f32; 3]],
        loss: impl Fn(usize, [f32; 3]) -> LocalQuadratic + Sync,
    ) -> Self {
        assert_eq!(base.len(), directions.len(), "a log radiance for each direction");
        let rows = LobeRows::of(lobes);
        let unknowns = Lobe::COORDINATES * lobes.len();
        let parts = in_tasks(directions, TASK, TASKS, |scratch, first, directions| {
            let mut sums = Self::zero(unknowns);
            let base = &base[first..][..directions.len()];
            let loss = |i, p| loss(first + i, p);
            pulp::Arch::new().dispatch(OfLobes {
                lobes: &rows,
                base,
                directions,
                loss: &loss,
                sums: &mut sums,
                scratch,
            });
            sums
        });
        let mut total = Self::zero(unknowns);
        parts.iter().for_each(|part| total.add(part));
        total
    }
}

/// Work for one thread: any number of directions.
struct OfLobes<'a> {
    lobes: &'a [LobeRows],
    base: &'a [[f32; 3]],
    directions: &'a [[f32; 3]],
    loss: &'a QuadraticLoss<'a>,
    sums: &'a mut NormalEquations,
    scratch: &'a mut Aligned,
}

impl WithSimd for OfLobes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { lobes, base, directions, loss, sums, scratch } = self;
        let (lanes, unknowns) = (outer::lanes::<S>(), LobeRows::OF_COLOUR * lobes.len());
        let panels = outer::panels::<S>(unknowns);
        let wide = size_of::<Wide<S>>() / size_of::<S::f32s>();
        let rows = 2 * 3 + BlockEquations::<S>::rows(unknowns) + 2 * unknowns;
        let vectors = wide * panels * (lanes + 3 * unknowns) + 3 * unknowns;
        let scratch = scratch.at_least(lanes * rows + S::F32_LANES * vectors);
        let (all, workspace) = S::as_mut_simd_f32s(scratch).0.split_at_mut(VECTORS * rows);
        let all: &mut [Row<S>] = all.as_chunks_mut::<VECTORS>().0;
        let (direction, all) = all.split_at_mut(3);
        let (rgb, all) = all.split_at_mut(3);
        workspace[..vectors].fill(simd.splat_f32s(0.0));
        let (transposed, workspace) = workspace.split_at_mut(wide * panels * lanes);
        let (matrices, gradient) = workspace.split_at_mut(3 * wide * panels * unknowns);
        let matrices: &mut [Wide<S>] = matrices.as_chunks_mut().0;
        let (mut block, all) = BlockEquations::new(unknowns, all, transposed.as_chunks_mut().0);
        let (shapes, jacobian) = all.split_at_mut(unknowns);
        // without lobes there is a loss and nothing that moves
        let colours = if lobes.is_empty() { 0 } else { 3 };

        for (b, (directions, base)) in directions.chunks(lanes).zip(base.chunks(lanes)).enumerate() {
            fill::<S>(directions, direction);
            fill::<S>(base, rgb);
            LobeRows::shapes(lobes, simd, direction, shapes, rgb);
            block.ask(loss, b * lanes, directions.len(), rgb, 0.0, &mut sums.loss);
            for c in 0..colours {
                LobeRows::of_colour(lobes, simd, shapes, c, jacobian);
                let gradient = &mut gradient[c * unknowns..][..unknowns];
                let matrix = &mut matrices[c * panels * unknowns..][..panels * unknowns];
                block.add(simd, c, jacobian, gradient, matrix);
            }
        }

        let n = sums.gradient.len();
        let mut row = vec![0.0; unknowns];
        for c in 0..colours {
            for k in 0..unknowns {
                let at = LobeRows::coordinate(k, c);
                sums.gradient[at] += lane_sum::<S>(&gradient[c * unknowns + k]);
                row.fill(0.0);
                let matrix = &matrices[c * panels * unknowns..][..panels * unknowns];
                outer::read::<S>(matrix, unknowns, k, &mut row);
                for (j, value) in row.iter().enumerate() {
                    sums.matrix[at * n + LobeRows::coordinate(j, c)] += f64::from(*value);
                }
            }
        }
    }
}

/// At most a block of triples into three rows; what is beyond them stays finite.
#[inline(always)]
fn fill<S: Simd>(triples: &[[f32; 3]], rows: &mut [Row<S>]) {
    let lanes = outer::lanes::<S>();
    let flat = flat_mut::<S>(rows);
    flat.fill(0.0);
    for (i, triple) in triples.iter().enumerate() {
        for (c, value) in triple.iter().enumerate() {
            flat[c * lanes + i] = *value;
        }
    }
}
