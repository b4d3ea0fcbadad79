//! The network for a block of directions at a time. MODEL (16, 18–20).
//!
//! A block is three vectors of lanes, one direction per lane. Activations are feature-major: one [`Row`] (three
//! vectors) per feature, so that layer norm, encoding and ReLU are plain vector code, and a weight is one
//! scalar against three vectors. A register tile of 8 outputs × 3 vectors (4 × 3 where there are 16 registers)
//! runs over all inputs. Every lane adds in the same order whatever the width of the vectors.

use pulp::{Simd, WithSimd};

use super::aligned::Aligned;
use super::mlp::{Matrix, Mlp, PANEL};
use super::{Folded, lobes, math};

/// Vectors per row.
pub(super) const VECTORS: usize = 3;
/// Interleaved partial sums of a layer norm: enough to hide the latency of addition.
pub(super) const PARTIAL: usize = 4;
/// ε of layer norm.
pub(super) const EPSILON: f32 = 1e-5;

/// A feature of a block: one value per direction.
pub(super) type Row<S> = [<S as Simd>::f32s; VECTORS];

/// Work for one thread: any number of directions, one after the other in blocks.
pub(super) struct Blocks<'a> {
    pub(super) mlp: &'a Mlp,
    pub(super) folded: &'a Folded,
    pub(super) directions: &'a [[f32; 3]],
    /// As many as directions.
    pub(super) out: &'a mut [[f32; 3]],
    /// Log radiance instead of radiance.
    pub(super) log: bool,
    /// Whether radiance includes the lights.
    pub(super) lights: bool,
    pub(super) scratch: &'a mut Aligned,
}

impl WithSimd for Blocks<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { mlp, folded, directions, out, log, lights, scratch } = self;
        let row = VECTORS * S::F32_LANES;
        let (hidden, widest) = (mlp.padded(), mlp.input.iter().map(|c| c.weight.inputs).max().unwrap_or(0));
        let scratch = scratch.at_least(row * (4 + hidden + hidden.max(widest) + PANEL));
        let (rows, _) = S::as_mut_simd_f32s(scratch).0.as_chunks_mut::<VECTORS>();
        let (direction, rows) = rows.split_at_mut(4);
        let (x, rows) = rows.split_at_mut(hidden);
        let (y, rows) = rows.split_at_mut(hidden.max(widest));
        let rgb = &mut rows[..PANEL];
        for (directions, out) in directions.chunks(row).zip(out.chunks_mut(row)) {
            scatter(simd, directions, direction);
            network(simd, mlp, folded, direction, x, y, rgb);
            lobes::add(simd, &folded.lobes, direction, &mut rgb[..3]);
            let offset = simd.splat_f32s(folded.log_exposure);
            for value in rgb[..3].as_flattened_mut() {
                *value = simd.add_f32s(*value, offset);
                if !log {
                    *value = math::exp(simd, *value);
                }
            }
            let rgb: &[f32] = bytemuck::cast_slice(rgb);
            for (i, out) in out.iter_mut().enumerate() {
                *out = [rgb[i], rgb[row + i], rgb[2 * row + i]];
            }
            if !log && lights {
                let both = directions.iter().zip(out.iter_mut());
                both.for_each(|(d, out)| folded.emitters.iter().for_each(|light| light.add(*d, out)));
            }
        }
    }
}

/// Directions to rows x, y, z and √(x² + y²). A short last block keeps finite numbers in its idle lanes.
#[inline(always)]
pub(super) fn scatter<S: Simd>(simd: S, directions: &[[f32; 3]], rows: &mut [Row<S>]) {
    let lanes = VECTORS * S::F32_LANES;
    let flat: &mut [f32] = bytemuck::cast_slice_mut(rows.as_flattened_mut());
    for (i, direction) in directions.iter().enumerate() {
        for (k, value) in direction.iter().enumerate() {
            flat[k * lanes + i] = *value;
        }
    }
    let [xs, ys, _, radii] = rows else { unreachable!("a direction is four rows") };
    for ((radius, x), y) in radii.iter_mut().zip(xs).zip(ys) {
        *radius = simd.sqrt_f32s(simd.mul_add_f32s(*x, *x, simd.mul_f32s(*y, *y)));
    }
}

/// Log radiance of one block into the first three rows of `rgb`. `x` and `y` are scratch for activations.
#[inline(always)]
fn network<S: Simd>(
    simd: S,
    mlp: &Mlp,
    folded: &Folded,
    direction: &[Row<S>],
    x: &mut [Row<S>],
    y: &mut [Row<S>],
    rgb: &mut [Row<S>],
) {
    let hidden = mlp.hidden;
    for (i, chunk) in mlp.input.iter().enumerate() {
        encode(simd, folded, chunk.inputs.clone(), direction, y);
        if i == 0 {
            product::<S, false, false>(simd, &chunk.weight, &folded.input_bias, y, x);
        } else {
            product::<S, true, false>(simd, &chunk.weight, &folded.no_bias, y, x);
        }
    }
    for (layer, shift) in mlp.layers.iter().zip(&folded.shift) {
        normalise(simd, &mut x[..hidden], &layer.gamma1, &layer.beta1);
        product::<S, false, true>(simd, &layer.ff1, &layer.ff1_bias, x, y);
        product::<S, true, false>(simd, &layer.ff2, &layer.ff2_bias, y, x);
        normalise(simd, &mut x[..hidden], &layer.gamma2, shift);
    }
    product::<S, false, false>(simd, &mlp.output, &mlp.output_bias, x, rgb);
}

/// Five features of each directional input: sine and cosine at frequencies 1 and 4, and the input itself.
#[inline(always)]
pub(super) fn encode<S: Simd>(
    simd: S,
    folded: &Folded,
    inputs: std::ops::Range<usize>,
    direction: &[Row<S>],
    features: &mut [Row<S>],
) {
    let n = folded.vectors.len();
    let (out, _) = features.as_chunks_mut::<5>();
    for (j, out) in inputs.zip(out) {
        for v in 0..VECTORS {
            let (value, turns) = match folded.vectors.get(j) {
                Some(z) => inner_product(
                    simd,
                    [simd.splat_f32s(z[0]), simd.splat_f32s(z[1])],
                    [direction[0][v], direction[1][v]],
                ),
                None => [direction[2 + j - n][v]; 2].into(),
            };
            let [sin1, cos1] = math::sin_cos_turns(simd, turns);
            // times 4 is exact, so the second frequency is as accurate as the first
            let [sin4, cos4] = math::sin_cos_turns(simd, simd.mul_f32s(turns, simd.splat_f32s(4.0)));
            for (row, value) in out.iter_mut().zip([sin1, sin4, cos1, cos4, value]) {
                row[v] = value;
            }
        }
    }
}

/// ⟨z, d⟩ rounded, and the same in turns modulo 1 with an error that does not grow with |z|: the products'
/// rounding errors are recovered by fused multiply-add, and whole turns are dropped before adding.
#[inline(always)]
pub(super) fn inner_product<S: Simd>(simd: S, z: [S::f32s; 2], d: [S::f32s; 2]) -> (S::f32s, S::f32s) {
    let (a, b) = (simd.mul_f32s(z[0], d[0]), simd.mul_f32s(z[1], d[1]));
    let a_low = simd.mul_add_f32s(z[0], d[0], simd.neg_f32s(a));
    let b_low = simd.mul_add_f32s(z[1], d[1], simd.neg_f32s(b));
    let high = simd.add_f32s(math::fraction(simd, a), math::fraction(simd, b));
    (simd.add_f32s(a, b), simd.add_f32s(high, simd.add_f32s(a_low, b_low)))
}

/// y = W x + b, with ADD y + W x + b, with RELU max(0, ·). Bias has a value for every row of whole panels.
#[inline(always)]
pub(super) fn product<S: Simd, const ADD: bool, const RELU: bool>(
    simd: S,
    weight: &Matrix,
    bias: &[f32],
    x: &[Row<S>],
    y: &mut [Row<S>],
) {
    let x = &x[..weight.inputs];
    let (bias, _) = bias.as_chunks::<PANEL>();
    let (y, _) = y.as_chunks_mut::<PANEL>();
    if let Some(pairs) = &weight.pairs {
        return pairs.product::<ADD, RELU>(bias, bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
    }
    for ((panel, bias), y) in weight.panels().zip(bias).zip(y) {
        // 24 sums and 3 inputs, or 12 sums, 3 inputs and a weight, fill the registers
        if S::REGISTER_COUNT >= 32 {
            tile::<S, 8, 0, ADD, RELU>(simd, panel, bias, x, y);
        } else {
            tile::<S, 4, 0, ADD, RELU>(simd, panel, bias, x, y);
            tile::<S, 4, 4, ADD, RELU>(simd, panel, bias, x, y);
        }
    }
}

/// Outputs FROM .. FROM + ROWS of a panel.
#[inline(always)]
fn tile<S: Simd, const ROWS: usize, const FROM: usize, const ADD: bool, const RELU: bool>(
    simd: S,
    panel: &[[f32; PANEL]],
    bias: &[f32; PANEL],
    x: &[Row<S>],
    y: &mut [Row<S>; PANEL],
) {
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
    for i in 0..ROWS {
        let bias = simd.splat_f32s(bias[FROM + i]);
        for v in 0..VECTORS {
            sums[i][v] = if ADD { simd.add_f32s(bias, y[FROM + i][v]) } else { bias };
        }
    }
    for (weights, x) in panel.iter().zip(x) {
        for i in 0..ROWS {
            let w = simd.splat_f32s(weights[FROM + i]);
            for v in 0..VECTORS {
                sums[i][v] = simd.mul_add_e_f32s(w, x[v], sums[i][v]);
            }
        }
    }
    let zero = simd.splat_f32s(0.0);
    for i in 0..ROWS {
        for v in 0..VECTORS {
            y[FROM + i][v] = if RELU { simd.max_f32s(sums[i][v], zero) } else { sums[i][v] };
        }
    }
}

/// x ← γ (x − mean)/√(variance + ε) + shift over the rows.
#[inline(always)]
fn normalise<S: Simd>(simd: S, x: &mut [Row<S>], gamma: &[f32], shift: &[f32]) {
    let (mean, mut scale) = moments(simd, x);
    for scale in &mut scale {
        let variance = simd.add_f32s(*scale, simd.splat_f32s(EPSILON));
        *scale = simd.div_f32s(simd.splat_f32s(1.0), simd.sqrt_f32s(variance));
    }
    for ((row, gamma), shift) in x.iter_mut().zip(gamma).zip(shift) {
        let (gamma, shift) = (simd.splat_f32s(*gamma), simd.splat_f32s(*shift));
        for v in 0..VECTORS {
            let centred = simd.sub_f32s(row[v], mean[v]);
            row[v] = simd.mul_add_e_f32s(centred, simd.mul_f32s(scale[v], gamma), shift);
        }
    }
}

/// Mean and variance over the rows.
#[inline(always)]
pub(super) fn moments<S: Simd>(simd: S, x: &[Row<S>]) -> (Row<S>, Row<S>) {
    let count = simd.splat_f32s(x.len() as f32);
    let mut mean = sum::<S, false>(simd, x, [simd.splat_f32s(0.0); VECTORS]);
    for mean in &mut mean {
        *mean = simd.div_f32s(*mean, count);
    }
    let mut variance = sum::<S, true>(simd, x, mean);
    for variance in &mut variance {
        *variance = simd.div_f32s(*variance, count);
    }
    (mean, variance)
}

/// Σ x over the rows, with SQUARES Σ (x − mean)², in [`PARTIAL`] interleaved sums.
#[inline(always)]
fn sum<S: Simd, const SQUARES: bool>(simd: S, x: &[Row<S>], mean: Row<S>) -> Row<S> {
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; PARTIAL];
    let (whole, rest) = x.as_chunks::<PARTIAL>();
    for rows in whole {
        for (sum, row) in sums.iter_mut().zip(rows) {
            accumulate::<S, SQUARES>(simd, sum, row, &mean);
        }
    }
    for (sum, row) in sums.iter_mut().zip(rest) {
        accumulate::<S, SQUARES>(simd, sum, row, &mean);
    }
    let [mut a, b, c, d] = sums;
    for v in 0..VECTORS {
        a[v] = simd.add_f32s(simd.add_f32s(a[v], b[v]), simd.add_f32s(c[v], d[v]));
    }
    a
}

#[inline(always)]
fn accumulate<S: Simd, const SQUARES: bool>(simd: S, sum: &mut Row<S>, row: &Row<S>, mean: &Row<S>) {
    for v in 0..VECTORS {
        let term = if SQUARES {
            let centred = simd.sub_f32s(row[v], mean[v]);
            simd.mul_f32s(centred, centred)
        } else {
            row[v]
        };
        sum[v] = simd.add_f32s(sum[v], term);
    }
}
