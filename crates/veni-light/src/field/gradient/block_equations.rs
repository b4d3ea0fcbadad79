//! What a block of directions adds to normal equations: the derivatives of its losses, and by the rows of the Jacobian of one
//! colour its part of the gradient and of the matrix. MODEL (41).

use pulp::Simd;

use super::normal::QuadraticLoss;
use super::operations::accumulate_product;
use super::outer::{self, Wide};
use super::pass::{flat, flat_mut};
use crate::field::block::{Row, VECTORS};

/// Workspace for one block after the other.
pub(super) struct BlockEquations<'a, S: Simd> {
    /// ℓ′ and ℓ″, a row for each colour.
    gradients: &'a mut [Row<S>],
    weights: &'a mut [Row<S>],
    /// The rows of the Jacobian times ℓ″, and these direction by direction.
    weighted: &'a mut [Row<S>],
    transposed: &'a mut [Wide<S>],
}

impl<'a, S: Simd> BlockEquations<'a, S> {
    /// Rows that it takes for so many unknowns.
    pub(super) fn rows(unknowns: usize) -> usize {
        2 * 3 + unknowns
    }

    /// In the first rows of `workspace`, and all of `transposed`, zeros, for a block of panels; the other rows are given back.
    #[inline(always)]
    pub(super) fn new(
        unknowns: usize,
        workspace: &'a mut [Row<S>],
        transposed: &'a mut [Wide<S>],
    ) -> (Self, &'a mut [Row<S>]) {
        let (gradients, rest) = workspace.split_at_mut(3);
        let (weights, rest) = rest.split_at_mut(3);
        let (weighted, rest) = rest.split_at_mut(unknowns);
        (Self { gradients, weights, weighted, transposed }, rest)
    }

    /// Adds the losses of `count` directions, the first of them the `first`th of all, whose log radiance is `rgb` plus
    /// `log_exposure`, and keeps their derivatives.
    #[inline(always)]
    pub(super) fn ask(
        &mut self,
        loss: &QuadraticLoss<'_>,
        first: usize,
        count: usize,
        rgb: &[Row<S>],
        log_exposure: f32,
        sum: &mut f64,
    ) {
        let (rgb, lanes) = (flat::<S>(rgb), outer::lanes::<S>());
        let (gradients, weights) = (flat_mut::<S>(self.gradients), flat_mut::<S>(self.weights));
        // idle lanes of a short block count nothing
        gradients.fill(0.0);
        weights.fill(0.0);
        for i in 0..count {
            let local = loss(first + i, [0, 1, 2].map(|c| rgb[c * lanes + i] + log_exposure));
            *sum += local.loss;
            for c in 0..3 {
                gradients[c * lanes + i] = local.gradient[c];
                weights[c * lanes + i] = local.weight[c];
            }
        }
    }

    /// Adds Jᵀ ℓ′ to `gradient` and Jᵀ diag(ℓ″) J to `matrix`, with the rows J of colour `c`.
    #[inline(always)]
    pub(super) fn add(
        &mut self,
        simd: S,
        c: usize,
        jacobian: &[Row<S>],
        gradient: &mut [S::f32s],
        matrix: &mut [Wide<S>],
    ) {
        for ((weighted, row), sum) in self.weighted.iter_mut().zip(jacobian).zip(gradient) {
            for v in 0..VECTORS {
                weighted[v] = simd.mul_f32s(row[v], self.weights[c][v]);
            }
            *sum = accumulate_product(simd, *sum, row, &self.gradients[c]);
        }
        outer::transpose::<S>(self.weighted, self.transposed);
        outer::add(simd, jacobian, self.transposed, matrix);
    }
}
