//! One task: its directions in blocks, each forward with its activations kept, then backward.

use pulp::{Simd, WithSimd};

use super::operations::{
    accumulate, accumulate_product, accumulate_products, decode, mask, scale_and_shift, standardise,
    unstandardise,
};
use super::weight_sums::{WeightRoom, WeightSums, vector};
use crate::field::Folded;
use crate::field::aligned::Aligned;
use crate::field::block::{Row, VECTORS, encode, product, scatter};
use crate::field::mlp::{Mlp, PANEL};

/// ℓ and its derivatives by log radiance, given the direction's index and log radiance.
pub(super) type PixelLoss<'a> = dyn Fn(usize, [f32; 3]) -> (f64, [f32; 3]) + Sync + 'a;

/// Gradients by what conditioning leaves of a latent, summed over directions.
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
    /// Where the gradients by the weights are added, if they are wanted.
    pub(super) weights: Option<&'a mut WeightSums>,
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
    fn rows(mlp: &Mlp) -> usize {
        3 * mlp.padded() + 2
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
        let Self { mlp, folded, directions, loss, sums, weights, scratch } = self;
        let (transposed, hidden) = (mlp.transposed(), mlp.hidden);
        let (lanes, padded, layers) = (VECTORS * S::F32_LANES, mlp.padded(), mlp.layers.len());
        let features: Vec<_> = mlp.input.iter().map(|c| c.weight.inputs.next_multiple_of(PANEL)).collect();
        let widest = features.iter().copied().max().unwrap_or(0);
        let encoded: usize = features.iter().sum();
        let added = (1 + layers) * hidden;
        let sum_rows = (added + 2 * folded.vectors.len()).div_ceil(VECTORS);
        let rows = 4 + 2 * PANEL + 2 * padded + widest + encoded + layers * Tape::<S>::rows(mlp) + sum_rows;
        let room = if weights.is_some() { WeightRoom::<S>::vectors(mlp) } else { 0 };
        let scratch = scratch.at_least(lanes * rows + S::F32_LANES * room);
        let (all, room) = S::as_mut_simd_f32s(scratch).0.split_at_mut(VECTORS * rows);
        let (all, _) = all.as_chunks_mut::<VECTORS>();
        let (direction, all) = all.split_at_mut(4);
        let (rgb, all) = all.split_at_mut(PANEL);
        let (adjoint, all) = all.split_at_mut(PANEL);
        let (x, all) = all.split_at_mut(padded);
        let (y, all) = all.split_at_mut(padded);
        let (back, all) = all.split_at_mut(widest);
        let (encodings, all) = all.split_at_mut(encoded);
        let (tapes, lane_sums) = all.split_at_mut(layers * Tape::<S>::rows(mlp));
        let lane_sums = lane_sums.as_flattened_mut();
        lane_sums.fill(simd.splat_f32s(0.0));
        let mut weights = weights.map(|sums| (sums, WeightRoom::new(simd, mlp, room)));
        let zeros = vec![0.0f32; padded.max(widest)];

        for (b, directions) in directions.chunks(lanes).enumerate() {
            scatter(simd, directions, direction);
            // forward
            let mut from = 0;
            for (i, (chunk, rows)) in mlp.input.iter().zip(&features).enumerate() {
                let features = &mut encodings[from..from + rows];
                encode(simd, folded, chunk.inputs.clone(), direction, features);
                if i == 0 {
                    product::<S, false, false>(simd, &chunk.weight, &folded.input_bias, features, x);
                } else {
                    product::<S, true, false>(simd, &chunk.weight, &folded.no_bias, features, x);
                }
                from += rows;
            }
            let layer_tapes = tapes.chunks_exact_mut(Tape::<S>::rows(mlp));
            for ((layer, shift), tape) in mlp.layers.iter().zip(&folded.shift).zip(layer_tapes) {
                let tape = Tape::<S>::split(tape, padded);
                tape.scales[0] = standardise(simd, &x[..hidden], tape.first);
                scale_and_shift(simd, &tape.first[..hidden], &layer.gamma1, &layer.beta1, x);
                product::<S, false, true>(simd, &layer.ff1, &layer.ff1_bias, x, tape.units);
                product::<S, true, false>(simd, &layer.ff2, &layer.ff2_bias, tape.units, x);
                tape.scales[1] = standardise(simd, &x[..hidden], tape.second);
                scale_and_shift(simd, &tape.second[..hidden], &layer.gamma2, shift, x);
            }
            product::<S, false, false>(simd, &mlp.output, &mlp.output_bias, x, rgb);
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
            if let Some((_, room)) = &mut weights {
                for (gradient, sums) in adjoint.iter().zip(room.output.chunks_exact_mut(hidden)) {
                    for (sum, x) in sums.iter_mut().zip(x.iter()) {
                        *sum = accumulate_product(simd, *sum, x, gradient);
                    }
                }
                accumulate(simd, &adjoint[..3], room.output_bias);
            }
            product::<S, false, false>(simd, &transposed.output, &zeros, adjoint, x);
            for (l, layer) in mlp.layers.iter().enumerate().rev() {
                let rows = Tape::<S>::rows(mlp);
                let tape = Tape::<S>::split(&mut tapes[l * rows..][..rows], padded);
                let (first, second) = (&tape.first[..hidden], &tape.second[..hidden]);
                accumulate(simd, &x[..hidden], &mut lane_sums[(l + 1) * hidden..][..hidden]);
                if let Some((_, room)) = &mut weights {
                    accumulate_products(simd, x, second, room.layers[l].vectors[vector::GAMMA2]);
                }
                unstandardise(simd, x, &layer.gamma2, second, tape.scales[1]);
                let [ff1, ff2] = &transposed.layers[l];
                product::<S, false, false>(simd, ff2, &zeros, x, y);
                mask(simd, y, tape.units);
                if let Some((_, room)) = &mut weights {
                    room.add_ff2(simd, l, &tape.units[..hidden], &x[..hidden]);
                    room.add_ff1(simd, l, first, &y[..hidden]);
                    let sums = &mut room.layers[l].vectors;
                    accumulate(simd, &x[..hidden], sums[vector::FF2_BIAS]);
                    accumulate(simd, &y[..hidden], sums[vector::FF1_BIAS]);
                }
                // added to the way round the branch
                product::<S, true, false>(simd, ff1, &zeros, y, x);
                if let Some((_, room)) = &mut weights {
                    accumulate(simd, &x[..hidden], room.layers[l].vectors[vector::BETA1]);
                    accumulate_products(simd, x, first, room.layers[l].vectors[vector::GAMMA1]);
                }
                unstandardise(simd, x, &layer.gamma1, first, tape.scales[0]);
            }
            accumulate(simd, &x[..hidden], &mut lane_sums[..hidden]);
            let vectors = &mut lane_sums[added..];
            let mut from = 0;
            for ((chunk, matrix), rows) in mlp.input.iter().zip(&transposed.input).zip(&features) {
                product::<S, false, false>(simd, matrix, &zeros, x, back);
                let features = &encodings[from..from + rows];
                decode(simd, chunk.inputs.clone(), features, back, direction, vectors);
                from += rows;
            }
            if let Some((_, room)) = &mut weights {
                room.add_input(simd, mlp, encodings, &x[..hidden]);
            }
        }
        let lanes = |v: &S::f32s| -> f64 {
            bytemuck::cast_slice::<S::f32s, f32>(std::slice::from_ref(v)).iter().map(|x| f64::from(*x)).sum()
        };
        let (added, vectors) = lane_sums.split_at(added);
        for (sum, rows) in sums.added.iter_mut().zip(added) {
            *sum += lanes(rows);
        }
        for (sum, rows) in sums.vectors.as_flattened_mut().iter_mut().zip(vectors) {
            *sum += lanes(rows);
        }
        if let Some((sums, room)) = weights {
            room.drain(mlp, sums);
        }
    }
}
