//! The network for one direction: lanes run over outputs instead of directions. MODEL (18–20).
//!
//! It reads the weights once, at the speed of the second-level cache, where a block of one would do all the
//! work of a full block. Every sum is taken in the order of `block`, so the bits are the same.

use pulp::{Simd, WithSimd};

use super::block::{Blocks, EPSILON, PARTIAL, inner_product};
use super::lobes::{self, first};
use super::mlp::{Matrix, Mlp, PANEL};
use super::{Folded, math};

/// Panels that run side by side: enough independent sums to hide the latency of multiply-add.
const SIDE: usize = 8;

/// The same work with a few directions, one by one.
pub(super) struct Single<'a>(pub(super) Blocks<'a>);

impl WithSimd for Single<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self(Blocks { mlp, folded, directions, out, log, lights, scratch }) = self;
        let (inputs, padded) = (5 * (folded.vectors.len() + 2), mlp.padded());
        let all = &mut scratch.at_least(inputs + 2 * padded)[..inputs + 2 * padded];
        // what is padding must be 0
        all.fill(0.0);
        let (features, rest) = all.split_at_mut(inputs);
        let (x, y) = rest.split_at_mut(padded);
        for (direction, out) in directions.iter().zip(out) {
            encode(simd, folded, *direction, features);
            let mut rgb = network::<S>(mlp, folded, features, x, y);
            lobes::add_one(simd, &folded.lobes, *direction, &mut rgb);
            *out = rgb.map(|value| {
                let value = value + folded.log_exposure;
                if log { value } else { first(math::exp(simd, simd.splat_f32s(value))) }
            });
            if !log && lights {
                folded.emitters.iter().for_each(|light| light.add(*direction, out));
            }
        }
    }
}

/// Five features of each directional input, as in `block`, a lane per input.
#[inline(always)]
fn encode<S: Simd>(simd: S, folded: &Folded, direction: [f32; 3], features: &mut [f32]) {
    let [x, y, z] = direction;
    let (x, y, z) = (simd.splat_f32s(x), simd.splat_f32s(y), simd.splat_f32s(z));
    let radius = simd.sqrt_f32s(simd.mul_add_f32s(x, x, simd.mul_f32s(y, y)));
    let lanes = S::F32_LANES;
    for (vectors, features) in folded.vectors.chunks(lanes).zip(features.chunks_mut(5 * lanes)) {
        let mut both = [simd.splat_f32s(0.0); 2];
        let flat: &mut [f32] = bytemuck::cast_slice_mut(&mut both);
        for (i, [a, b]) in vectors.iter().enumerate() {
            (flat[i], flat[lanes + i]) = (*a, *b);
        }
        let (value, turns) = inner_product(simd, both, [x, y]);
        write(simd, &mut features[..5 * vectors.len()], value, turns);
    }
    let n = folded.vectors.len();
    write(simd, &mut features[5 * n..5 * (n + 1)], z, z);
    write(simd, &mut features[5 * (n + 1)..], radius, radius);
}

/// The features of as many inputs as there is room for, at most one per lane.
#[inline(always)]
fn write<S: Simd>(simd: S, features: &mut [f32], value: S::f32s, turns: S::f32s) {
    let [sin1, cos1] = math::sin_cos_turns(simd, turns);
    let [sin4, cos4] = math::sin_cos_turns(simd, simd.mul_f32s(turns, simd.splat_f32s(4.0)));
    let columns = [sin1, sin4, cos1, cos4, value];
    let columns: &[f32] = bytemuck::cast_slice(&columns);
    for (i, features) in features.chunks_exact_mut(5).enumerate() {
        for (k, feature) in features.iter_mut().enumerate() {
            *feature = columns[k * S::F32_LANES + i];
        }
    }
}

#[inline(always)]
fn network<S: Simd>(mlp: &Mlp, folded: &Folded, features: &[f32], x: &mut [f32], y: &mut [f32]) -> [f32; 3] {
    let hidden = mlp.hidden;
    for (i, chunk) in mlp.input.iter().enumerate() {
        let features = &features[5 * chunk.inputs.start..];
        if i == 0 {
            product::<S, false, false>(&chunk.weight, &folded.input_bias, features, x);
        } else {
            product::<S, true, false>(&chunk.weight, &folded.no_bias, features, x);
        }
    }
    for (layer, shift) in mlp.layers.iter().zip(&folded.shift) {
        normalise::<S>(&mut x[..hidden], &layer.gamma1, &layer.beta1);
        product::<S, false, true>(&layer.ff1, &layer.ff1_bias, x, y);
        product::<S, true, false>(&layer.ff2, &layer.ff2_bias, y, x);
        normalise::<S>(&mut x[..hidden], &layer.gamma2, shift);
    }
    let mut rgb = [0.0; PANEL];
    product::<S, false, false>(&mlp.output, &mlp.output_bias, x, &mut rgb);
    [rgb[0], rgb[1], rgb[2]]
}

/// a b + c as `mul_add_e` does it: fused wherever the processor can.
#[inline(always)]
fn multiply_add<S: Simd>(a: f32, b: f32, c: f32) -> f32 {
    if S::IS_SCALAR { a * b + c } else { a.mul_add(b, c) }
}

/// y = W x + b, with ADD y + W x + b, with RELU max(0, ·).
#[inline(always)]
fn product<S: Simd, const ADD: bool, const RELU: bool>(
    weight: &Matrix,
    bias: &[f32],
    x: &[f32],
    y: &mut [f32],
) {
    let inputs = weight.inputs;
    let x = &x[..inputs];
    let panels: &[[f32; PANEL]] = weight.rows();
    let (bias, y) = (bias.as_chunks::<PANEL>().0, y.as_chunks_mut::<PANEL>().0);
    let side = panels.chunks(SIDE * inputs).zip(bias.chunks(SIDE)).zip(y.chunks_mut(SIDE));
    for ((panels, bias), y) in side {
        if panels.len() == SIDE * inputs {
            let panels: [&[[f32; PANEL]]; SIDE] = std::array::from_fn(|p| &panels[p * inputs..][..inputs]);
            panel_group::<S, SIDE, ADD, RELU>(panels, bias, x, y);
        } else {
            for ((panel, bias), y) in panels.chunks_exact(inputs).zip(bias).zip(y) {
                panel_group::<S, 1, ADD, RELU>([panel], &[*bias], x, std::slice::from_mut(y));
            }
        }
    }
}

#[inline(always)]
fn panel_group<S: Simd, const COUNT: usize, const ADD: bool, const RELU: bool>(
    panels: [&[[f32; PANEL]]; COUNT],
    bias: &[[f32; PANEL]],
    x: &[f32],
    y: &mut [[f32; PANEL]],
) {
    let mut sums: [[f32; PANEL]; COUNT] = std::array::from_fn(|p| bias[p]);
    if ADD {
        for p in 0..COUNT {
            for i in 0..PANEL {
                sums[p][i] += y[p][i];
            }
        }
    }
    let panels = panels.map(|panel| &panel[..x.len()]);
    for (k, x) in x.iter().enumerate() {
        for p in 0..COUNT {
            for i in 0..PANEL {
                sums[p][i] = multiply_add::<S>(panels[p][k][i], *x, sums[p][i]);
            }
        }
    }
    for p in 0..COUNT {
        y[p] = if RELU { sums[p].map(|v| if v > 0.0 { v } else { 0.0 }) } else { sums[p] };
    }
}

#[inline(always)]
fn normalise<S: Simd>(x: &mut [f32], gamma: &[f32], shift: &[f32]) {
    let count = x.len() as f32;
    let mean = sum(x, |x| x) / count;
    let variance = sum(x, |x| (x - mean) * (x - mean)) / count;
    let scale = 1.0 / (variance + EPSILON).sqrt();
    for ((x, gamma), shift) in x.iter_mut().zip(gamma).zip(shift) {
        *x = multiply_add::<S>(*x - mean, scale * gamma, *shift);
    }
}

#[inline(always)]
fn sum(x: &[f32], term: impl Fn(f32) -> f32) -> f32 {
    let mut sums = [0.0; PARTIAL];
    let (whole, rest) = x.as_chunks::<PARTIAL>();
    for x in whole {
        for (sum, x) in sums.iter_mut().zip(x) {
            *sum += term(*x);
        }
    }
    for (sum, x) in sums.iter_mut().zip(rest) {
        *sum += term(*x);
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
