//! One block of directions through the network and back, with its activations kept in between.

use pulp::Simd;

use super::operations::{mask, scale_and_shift, standardise, unencode, unstandardise};
use crate::field::block::{Row, encode, product, scatter};
use crate::field::mlp::{Mlp, PANEL};
use crate::field::{Folded, lobes};

/// Hooks of the backward pass, given the gradient there. Called in the order of that pass: the output, the last layer
/// from its second norm to its first, …, what is added before the first layer, the directional inputs.
pub(super) trait BackwardVisitor<S: Simd> {
    /// By what is added before the first layer (`at` = 0), or after `at` layers.
    fn added(&mut self, simd: S, at: usize, gradient: &[Row<S>]);

    /// By the product of latent vector `j` with the directions in vector `v` of a row, and these directions' x and y.
    fn product(&mut self, simd: S, j: usize, v: usize, gradient: S::f32s, direction: [S::f32s; 2]);

    /// By the three outputs, x being what the output layer was given.
    #[inline(always)]
    fn output(&mut self, _simd: S, _x: &[Row<S>], _gradient: &[Row<S>]) {}

    /// By the result of layer `l`'s second norm.
    #[inline(always)]
    fn second_norm(&mut self, _simd: S, _l: usize, _gradient: &[Row<S>], _standard: &[Row<S>]) {}

    /// By the results of the two feed-forward maps of layer `l`.
    #[inline(always)]
    fn feed_forward(&mut self, _simd: S, _l: usize, _tape: &Tape<'_, S>, _by: [&[Row<S>]; 2]) {}

    /// By the result of layer `l`'s first norm.
    #[inline(always)]
    fn first_norm(&mut self, _simd: S, _l: usize, _gradient: &[Row<S>], _standard: &[Row<S>]) {}

    /// By the result of the input projection, given all features.
    #[inline(always)]
    fn input(&mut self, _simd: S, _features: &[Row<S>], _gradient: &[Row<S>]) {}
}

/// What a layer keeps for the backward pass.
pub(super) struct Tape<'a, S: Simd> {
    /// Standardised input of the first norm.
    pub(super) first: &'a mut [Row<S>],
    /// Hidden units after the ReLU.
    pub(super) units: &'a mut [Row<S>],
    /// Standardised input of the second norm.
    second: &'a mut [Row<S>],
    /// 1/√(variance + ε) of the two norms.
    scales: &'a mut [Row<S>],
}

impl<'a, S: Simd> Tape<'a, S> {
    fn rows(mlp: &Mlp) -> usize {
        3 * mlp.padded() + 2
    }

    #[inline(always)]
    fn split(rows: &'a mut [Row<S>], padded: usize) -> Self {
        let (first, rows) = rows.split_at_mut(padded);
        let (units, rows) = rows.split_at_mut(padded);
        let (second, scales) = rows.split_at_mut(padded);
        Self { first, units, second, scales }
    }
}

/// Room for a block.
pub(super) struct Pass<'a, S: Simd> {
    mlp: &'a Mlp,
    folded: &'a Folded,
    /// Features of every chunk of directional inputs, filled up to whole panels.
    features: Vec<usize>,
    /// The block's directions: rows x, y, z.
    pub(super) direction: &'a mut [Row<S>],
    /// Log radiance without the exposure, after [`Pass::forward`].
    pub(super) rgb: &'a mut [Row<S>],
    /// The gradient with respect to log radiance, for [`Pass::backward`]; its rows beyond the third are 0.
    pub(super) adjoint: &'a mut [Row<S>],
    /// What the output layer is given.
    last: &'a mut [Row<S>],
    x: &'a mut [Row<S>],
    y: &'a mut [Row<S>],
    back: &'a mut [Row<S>],
    encodings: &'a mut [Row<S>],
    tapes: &'a mut [Row<S>],
    zeros: Vec<f32>,
}

/// Features of every chunk, filled up to whole panels.
fn features(mlp: &Mlp) -> impl Iterator<Item = usize> {
    mlp.input.iter().map(|chunk| chunk.weight.inputs.next_multiple_of(PANEL))
}

impl<'a, S: Simd> Pass<'a, S> {
    /// Rows that it takes.
    pub(super) fn rows(mlp: &Mlp) -> usize {
        let (widest, encoded) = (features(mlp).max().unwrap_or(0), features(mlp).sum::<usize>());
        4 + 2 * PANEL + 3 * mlp.padded() + widest + encoded + mlp.layers.len() * Tape::<S>::rows(mlp)
    }

    /// In the first rows of `workspace`; the others are given back.
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        mlp: &'a Mlp,
        folded: &'a Folded,
        workspace: &'a mut [Row<S>],
    ) -> (Self, &'a mut [Row<S>]) {
        let features: Vec<_> = features(mlp).collect();
        let (padded, widest) = (mlp.padded(), features.iter().copied().max().unwrap_or(0));
        let (direction, workspace) = workspace.split_at_mut(4);
        let (rgb, workspace) = workspace.split_at_mut(PANEL);
        let (adjoint, workspace) = workspace.split_at_mut(PANEL);
        let (last, workspace) = workspace.split_at_mut(padded);
        let (x, workspace) = workspace.split_at_mut(padded);
        let (y, workspace) = workspace.split_at_mut(padded);
        let (back, workspace) = workspace.split_at_mut(widest);
        let (encodings, workspace) = workspace.split_at_mut(features.iter().sum());
        let (tapes, workspace) = workspace.split_at_mut(mlp.layers.len() * Tape::<S>::rows(mlp));
        adjoint.as_flattened_mut().fill(simd.splat_f32s(0.0));
        let zeros = vec![0.0; padded.max(widest)];
        let pass = Self {
            mlp,
            folded,
            features,
            direction,
            rgb,
            adjoint,
            last,
            x,
            y,
            back,
            encodings,
            tapes,
            zeros,
        };
        (pass, workspace)
    }

    /// At most a block of directions to log radiance.
    #[inline(always)]
    pub(super) fn forward(&mut self, simd: S, directions: &[[f32; 3]]) {
        let Self { mlp, folded, features, direction, rgb, last: x, encodings, tapes, .. } = self;
        let (hidden, padded) = (mlp.hidden, mlp.padded());
        scatter(simd, directions, direction);
        let mut from = 0;
        for (i, (chunk, rows)) in mlp.input.iter().zip(features.iter()).enumerate() {
            let features = &mut encodings[from..from + rows];
            encode(simd, folded, chunk.inputs.clone(), direction, features);
            if i == 0 {
                product::<S, false, false>(simd, &chunk.weight, &folded.input_bias, features, x);
            } else {
                product::<S, true, false>(simd, &chunk.weight, &folded.no_bias, features, x);
            }
            from += rows;
        }
        let tapes = tapes.chunks_exact_mut(Tape::<S>::rows(mlp));
        for ((layer, shift), tape) in mlp.layers.iter().zip(&folded.shift).zip(tapes) {
            let tape = Tape::<S>::split(tape, padded);
            tape.scales[0] = standardise(simd, &x[..hidden], tape.first);
            scale_and_shift(simd, &tape.first[..hidden], &layer.gamma1, &layer.beta1, x);
            product::<S, false, true>(simd, &layer.ff1, &layer.ff1_bias, x, tape.units);
            product::<S, true, false>(simd, &layer.ff2, &layer.ff2_bias, tape.units, x);
            tape.scales[1] = standardise(simd, &x[..hidden], tape.second);
            scale_and_shift(simd, &tape.second[..hidden], &layer.gamma2, shift, x);
        }
        product::<S, false, false>(simd, &mlp.output, &mlp.output_bias, x, rgb);
        lobes::add(simd, &folded.lobes, direction, &mut rgb[..3]);
    }

    /// From [`Pass::adjoint`] back to the inputs of the block that went forward last. May be called again.
    #[inline(always)]
    pub(super) fn backward(&mut self, simd: S, visitor: &mut impl BackwardVisitor<S>) {
        let Self {
            mlp, folded, features, direction, adjoint, last, x, y, back, encodings, tapes, zeros, ..
        } = self;
        let (transposed, hidden, padded) = (mlp.transposed(), mlp.hidden, mlp.padded());
        visitor.output(simd, &last[..hidden], adjoint);
        product::<S, false, false>(simd, &transposed.output, zeros, adjoint, x);
        for (l, layer) in mlp.layers.iter().enumerate().rev() {
            let rows = Tape::<S>::rows(mlp);
            let tape = Tape::<S>::split(&mut tapes[l * rows..][..rows], padded);
            visitor.added(simd, l + 1, &x[..hidden]);
            visitor.second_norm(simd, l, &x[..hidden], &tape.second[..hidden]);
            unstandardise(simd, x, &layer.gamma2, &tape.second[..hidden], tape.scales[1]);
            let [ff1, ff2] = &transposed.layers[l];
            product::<S, false, false>(simd, ff2, zeros, x, y);
            mask(simd, y, tape.units);
            visitor.feed_forward(simd, l, &tape, [&y[..hidden], &x[..hidden]]);
            // added to the way round the branch
            product::<S, true, false>(simd, ff1, zeros, y, x);
            visitor.first_norm(simd, l, &x[..hidden], &tape.first[..hidden]);
            unstandardise(simd, x, &layer.gamma1, &tape.first[..hidden], tape.scales[0]);
        }
        visitor.added(simd, 0, &x[..hidden]);
        let mut from = 0;
        for ((chunk, matrix), rows) in mlp.input.iter().zip(&transposed.input).zip(features.iter()) {
            product::<S, false, false>(simd, matrix, zeros, x, back);
            let features = &encodings[from..from + rows];
            // the last two inputs, d_z and |d_xy|, are beyond the latent's vectors
            let inputs = chunk.inputs.start..chunk.inputs.end.min(folded.vectors.len());
            unencode(simd, inputs, features, back, |j, v, gradient| {
                visitor.product(simd, j, v, gradient, [direction[0][v], direction[1][v]]);
            });
            from += rows;
        }
        visitor.input(simd, encodings, &x[..hidden]);
    }
}

/// Values of a block, row by row, as plain numbers: `[rows, lanes]`.
pub(super) fn flat<S: Simd>(rows: &[Row<S>]) -> &[f32] {
    bytemuck::cast_slice(rows.as_flattened())
}

/// [`flat`], to be written.
pub(super) fn flat_mut<S: Simd>(rows: &mut [Row<S>]) -> &mut [f32] {
    bytemuck::cast_slice_mut(rows.as_flattened_mut())
}

/// The sum over the lanes of a vector.
pub(super) fn lane_sum<S: Simd>(vector: &S::f32s) -> f64 {
    let lanes = bytemuck::cast_slice::<S::f32s, f32>(std::slice::from_ref(vector));
    lanes.iter().map(|x| f64::from(*x)).sum()
}
