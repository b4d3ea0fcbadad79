//! One task: its directions in blocks, each forward with its activations kept, then backward.

use std::f32::consts::TAU;

use pulp::{Simd, WithSimd};

use super::Transposed;
use crate::field::Folded;
use crate::field::aligned::Aligned;
use crate::field::block::{EPSILON, Row, VECTORS, encode, moments, product, scatter};
use crate::field::weights::{PANEL, Weights};

/// ℓ and its derivatives by log radiance, given the direction's index and log radiance.
pub(super) type PixelLoss<'a> = dyn Fn(usize, [f32; 3]) -> (f64, [f32; 3]) + Sync + 'a;

/// Gradients by what conditioning leaves of a latent, summed over directions.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    pub(super) loss: f64,
    pub(super) log_exposure: f64,
    /// By x and y of the latent vectors, through the directional input only.
    pub(super) vectors: Vec<[f64; 2]>,
    /// By the attention vector of every layer, [layers, h].
    pub(super) attention: Vec<f64>,
}

impl Sums {
    pub(super) fn new(weights: &Weights) -> Self {
        Self {
            loss: 0.0,
            log_exposure: 0.0,
            vectors: vec![[0.0; 2]; weights.latent_vectors],
            attention: vec![0.0; weights.layers.len() * weights.hidden],
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.loss += other.loss;
        self.log_exposure += other.log_exposure;
        let pairs = self.vectors.as_flattened_mut().iter_mut().zip(other.vectors.as_flattened());
        let all = pairs.chain(self.attention.iter_mut().zip(&other.attention));
        for (sum, value) in all {
            *sum += value;
        }
    }
}

/// Work for one thread: any number of directions.
pub(super) struct Backward<'a> {
    pub(super) weights: &'a Weights,
    pub(super) transposed: &'a Transposed,
    pub(super) folded: &'a Folded,
    pub(super) directions: &'a [[f32; 3]],
    pub(super) loss: &'a PixelLoss<'a>,
    pub(super) sums: &'a mut Sums,
    pub(super) scratch: &'a mut Aligned,
}

/// What a layer leaves for the way back.
struct Tape<'a, S: Simd> {
    /// Standardised input of the first norm.
    first: &'a mut [Row<S>],
    /// Hidden units after the ReLU.
    units: &'a mut [Row<S>],
    /// Standardised input of the second norm.
    second: &'a mut [Row<S>],
    /// 1/√(variance + ε) of the two norms.
    scales: &'a mut [Row<S>],
}

impl<S: Simd> Tape<'_, S> {
    fn rows(weights: &Weights) -> usize {
        3 * weights.padded() + 2
    }
}

impl<'a, S: Simd> Tape<'a, S> {
    #[inline(always)]
    fn split(rows: &'a mut [Row<S>], padded: usize) -> Self {
        let (first, rows) = rows.split_at_mut(padded);
        let (units, rows) = rows.split_at_mut(padded);
        let (second, scales) = rows.split_at_mut(padded);
        Self { first, units, second, scales }
    }
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { weights, transposed, folded, directions, loss, sums, scratch } = self;
        let (lanes, padded, layers) = (VECTORS * S::F32_LANES, weights.padded(), weights.layers.len());
        let features: Vec<_> =
            weights.input.iter().map(|c| c.weight.inputs.next_multiple_of(PANEL)).collect();
        let widest = features.iter().copied().max().unwrap_or(0);
        let encoded: usize = features.iter().sum();
        let sum_rows = (layers * weights.hidden + 2 * weights.latent_vectors).div_ceil(VECTORS);
        let rows = 4 + 2 * PANEL + 2 * padded + widest + encoded + layers * Tape::<S>::rows(weights);
        let scratch = scratch.at_least(lanes * (rows + sum_rows));
        let (all, _) = S::as_mut_simd_f32s(scratch).0.as_chunks_mut::<VECTORS>();
        let (direction, all) = all.split_at_mut(4);
        let (rgb, all) = all.split_at_mut(PANEL);
        let (adjoint, all) = all.split_at_mut(PANEL);
        let (x, all) = all.split_at_mut(padded);
        let (y, all) = all.split_at_mut(padded);
        let (back, all) = all.split_at_mut(widest);
        let (encodings, all) = all.split_at_mut(encoded);
        let (tapes, all) = all.split_at_mut(layers * Tape::<S>::rows(weights));
        let lane_sums = all[..sum_rows].as_flattened_mut();
        lane_sums.fill(simd.splat_f32s(0.0));
        let zeros = vec![0.0f32; padded.max(widest)];

        for (b, directions) in directions.chunks(lanes).enumerate() {
            scatter(simd, directions, direction);
            // forward
            let mut from = 0;
            for (i, (chunk, rows)) in weights.input.iter().zip(&features).enumerate() {
                let features = &mut encodings[from..from + rows];
                encode(simd, folded, chunk.inputs.clone(), direction, features);
                if i == 0 {
                    product::<S, false, false>(simd, &chunk.weight, &folded.input_bias, features, x);
                } else {
                    product::<S, true, false>(simd, &chunk.weight, &folded.no_bias, features, x);
                }
                from += rows;
            }
            let layer_tapes = tapes.chunks_exact_mut(Tape::<S>::rows(weights));
            for ((layer, shift), tape) in weights.layers.iter().zip(&folded.shift).zip(layer_tapes) {
                let tape = Tape::<S>::split(tape, padded);
                let hidden = weights.hidden;
                tape.scales[0] = standardise(simd, &x[..hidden], tape.first);
                scale_and_shift(simd, &tape.first[..hidden], &layer.gamma1, &layer.beta1, x);
                product::<S, false, true>(simd, &layer.ff1, &layer.ff1_bias, x, tape.units);
                product::<S, true, false>(simd, &layer.ff2, &layer.ff2_bias, tape.units, x);
                tape.scales[1] = standardise(simd, &x[..hidden], tape.second);
                scale_and_shift(simd, &tape.second[..hidden], &layer.gamma2, shift, x);
            }
            product::<S, false, false>(simd, &weights.output, &weights.output_bias, x, rgb);
            // the loss
            {
                let rgb: &[f32] = bytemuck::cast_slice(rgb);
                let adjoint: &mut [f32] = bytemuck::cast_slice_mut(adjoint.as_flattened_mut());
                // idle lanes of a short block send nothing back
                adjoint.fill(0.0);
                for i in 0..directions.len() {
                    let p = [0, 1, 2].map(|c| rgb[c * lanes + i] + folded.log_exposure);
                    let (value, slope) = loss(b * lanes + i, p);
                    sums.loss += value;
                    for (c, g) in slope.into_iter().enumerate() {
                        sums.log_exposure += f64::from(g);
                        adjoint[c * lanes + i] = g;
                    }
                }
            }
            // backward
            product::<S, false, false>(simd, &transposed.output, &zeros, adjoint, x);
            for (l, layer) in weights.layers.iter().enumerate().rev() {
                let rows = Tape::<S>::rows(weights);
                let tape = Tape::<S>::split(&mut tapes[l * rows..][..rows], padded);
                let hidden = weights.hidden;
                // x + shift: the shift holds the attention of the layer after this one
                if l + 1 < layers {
                    accumulate(simd, &x[..hidden], &mut lane_sums[(l + 1) * hidden..][..hidden]);
                }
                unstandardise(simd, x, &layer.gamma2, &tape.second[..hidden], tape.scales[1]);
                let [ff1, ff2] = &transposed.layers[l];
                product::<S, false, false>(simd, ff2, &zeros, x, y);
                mask(simd, y, tape.units);
                // added to the way round the branch
                product::<S, true, false>(simd, ff1, &zeros, y, x);
                unstandardise(simd, x, &layer.gamma1, &tape.first[..hidden], tape.scales[0]);
            }
            accumulate(simd, &x[..weights.hidden], &mut lane_sums[..weights.hidden]);
            let vectors = &mut lane_sums[layers * weights.hidden..];
            let mut from = 0;
            for ((chunk, matrix), rows) in weights.input.iter().zip(&transposed.input).zip(&features) {
                product::<S, false, false>(simd, matrix, &zeros, x, back);
                let features = &encodings[from..from + rows];
                decode(simd, chunk.inputs.clone(), features, back, direction, vectors);
                from += rows;
            }
        }
        let lanes = |v: &S::f32s| -> f64 {
            bytemuck::cast_slice::<S::f32s, f32>(std::slice::from_ref(v)).iter().map(|x| f64::from(*x)).sum()
        };
        let (attention, vectors) = lane_sums.split_at(layers * weights.hidden);
        for (sum, rows) in sums.attention.iter_mut().zip(attention) {
            *sum += lanes(rows);
        }
        for (sum, rows) in sums.vectors.as_flattened_mut().iter_mut().zip(vectors) {
            *sum += lanes(rows);
        }
    }
}

/// (x − mean)/√(variance + ε) over the rows into `out`; returns 1/√(variance + ε).
#[inline(always)]
fn standardise<S: Simd>(simd: S, x: &[Row<S>], out: &mut [Row<S>]) -> Row<S> {
    let (mean, mut scale) = moments(simd, x);
    for scale in &mut scale {
        let variance = simd.add_f32s(*scale, simd.splat_f32s(EPSILON));
        *scale = simd.div_f32s(simd.splat_f32s(1.0), simd.sqrt_f32s(variance));
    }
    for (out, x) in out.iter_mut().zip(x) {
        for v in 0..VECTORS {
            out[v] = simd.mul_f32s(simd.sub_f32s(x[v], mean[v]), scale[v]);
        }
    }
    scale
}

/// γ x̂ + shift into `out`.
#[inline(always)]
fn scale_and_shift<S: Simd>(simd: S, x: &[Row<S>], gamma: &[f32], shift: &[f32], out: &mut [Row<S>]) {
    for (((out, x), gamma), shift) in out.iter_mut().zip(x).zip(gamma).zip(shift) {
        let (gamma, shift) = (simd.splat_f32s(*gamma), simd.splat_f32s(*shift));
        for v in 0..VECTORS {
            out[v] = simd.mul_add_e_f32s(x[v], gamma, shift);
        }
    }
}

/// Backward of γ x̂ + shift, x̂ = (x − mean)·s: with g = γ ⊙ gradient, s (g − mean g − x̂ · mean(g x̂)).
#[inline(always)]
fn unstandardise<S: Simd>(
    simd: S,
    gradient: &mut [Row<S>],
    gamma: &[f32],
    standard: &[Row<S>],
    scale: Row<S>,
) {
    let zero = simd.splat_f32s(0.0);
    let (mut mean, mut slope) = ([zero; VECTORS], [zero; VECTORS]);
    for ((g, gamma), x) in gradient.iter_mut().zip(gamma).zip(standard) {
        let gamma = simd.splat_f32s(*gamma);
        for v in 0..VECTORS {
            g[v] = simd.mul_f32s(g[v], gamma);
            mean[v] = simd.add_f32s(mean[v], g[v]);
            slope[v] = simd.mul_add_e_f32s(g[v], x[v], slope[v]);
        }
    }
    let count = simd.splat_f32s(1.0 / standard.len() as f32);
    for v in 0..VECTORS {
        mean[v] = simd.mul_f32s(mean[v], count);
        slope[v] = simd.mul_f32s(slope[v], count);
    }
    for (g, x) in gradient.iter_mut().zip(standard) {
        for v in 0..VECTORS {
            let inside = simd.sub_f32s(simd.sub_f32s(g[v], mean[v]), simd.mul_f32s(x[v], slope[v]));
            g[v] = simd.mul_f32s(inside, scale[v]);
        }
    }
}

/// Backward of the ReLU: nothing passes where a unit is 0.
#[inline(always)]
fn mask<S: Simd>(simd: S, gradient: &mut [Row<S>], units: &[Row<S>]) {
    let zero = simd.splat_f32s(0.0);
    for (g, unit) in gradient.iter_mut().zip(units) {
        for v in 0..VECTORS {
            g[v] = simd.select_f32s(simd.greater_than_f32s(unit[v], zero), g[v], zero);
        }
    }
}

/// Adds the rows, their vectors together, to one vector each.
#[inline(always)]
fn accumulate<S: Simd>(simd: S, rows: &[Row<S>], sums: &mut [S::f32s]) {
    for (sum, row) in sums.iter_mut().zip(rows) {
        *sum = simd.add_f32s(*sum, simd.add_f32s(row[0], simd.add_f32s(row[1], row[2])));
    }
}

/// Backward of the encoding: d⟨z, d⟩ of every latent vector, times d_x and d_y, into `sums` [N, 2].
#[inline(always)]
fn decode<S: Simd>(
    simd: S,
    inputs: std::ops::Range<usize>,
    features: &[Row<S>],
    gradient: &[Row<S>],
    direction: &[Row<S>],
    sums: &mut [S::f32s],
) {
    let (features, _) = features.as_chunks::<5>();
    let (gradient, _) = gradient.as_chunks::<5>();
    let (pairs, _) = sums.as_chunks_mut::<2>();
    let (slow, fast) = (simd.splat_f32s(TAU), simd.splat_f32s(4.0 * TAU));
    // the last two inputs, d_z and |d_xy|, are beyond the latent's vectors
    for ((j, [sin1, sin4, cos1, cos4, _]), [g_sin1, g_sin4, g_cos1, g_cos4, g]) in
        inputs.zip(features).zip(gradient)
    {
        let Some([dx, dy]) = pairs.get_mut(j) else { return };
        for v in 0..VECTORS {
            let one = turn(simd, [g_sin1[v], g_cos1[v]], [sin1[v], cos1[v]]);
            let four = turn(simd, [g_sin4[v], g_cos4[v]], [sin4[v], cos4[v]]);
            let p = simd.mul_add_e_f32s(one, slow, simd.mul_add_e_f32s(four, fast, g[v]));
            *dx = simd.mul_add_e_f32s(p, direction[0][v], *dx);
            *dy = simd.mul_add_e_f32s(p, direction[1][v], *dy);
        }
    }
}

/// Backward of (sin a, cos a), by a.
#[inline(always)]
fn turn<S: Simd>(simd: S, [g_sin, g_cos]: [S::f32s; 2], [sin, cos]: [S::f32s; 2]) -> S::f32s {
    simd.sub_f32s(simd.mul_f32s(g_sin, cos), simd.mul_f32s(g_cos, sin))
}
