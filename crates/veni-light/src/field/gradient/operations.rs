//! The steps of a layer that are not matrix products, forward and backward, over blocks. MODEL (38).

use std::f32::consts::TAU;

use pulp::Simd;

use crate::field::block::{EPSILON, Row, VECTORS, moments};

/// (x − mean)/√(variance + ε) over the rows into `out`; returns 1/√(variance + ε).
#[inline(always)]
pub(super) fn standardise<S: Simd>(simd: S, x: &[Row<S>], out: &mut [Row<S>]) -> Row<S> {
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
pub(super) fn scale_and_shift<S: Simd>(
    simd: S,
    x: &[Row<S>],
    gamma: &[f32],
    shift: &[f32],
    out: &mut [Row<S>],
) {
    for (((out, x), gamma), shift) in out.iter_mut().zip(x).zip(gamma).zip(shift) {
        let (gamma, shift) = (simd.splat_f32s(*gamma), simd.splat_f32s(*shift));
        for v in 0..VECTORS {
            out[v] = simd.mul_add_e_f32s(x[v], gamma, shift);
        }
    }
}

/// Backward of γ x̂ + shift, x̂ = (x − mean)·s: with g = γ ⊙ gradient, s (g − mean g − x̂ · mean(g x̂)).
#[inline(always)]
pub(super) fn unstandardise<S: Simd>(
    simd: S,
    gradient: &mut [Row<S>],
    gamma: &[f32],
    standard: &[Row<S>],
    scale: Row<S>,
) {
    let zero = simd.splat_f32s(0.0);
    let (mut mean, mut projection) = ([zero; VECTORS], [zero; VECTORS]);
    for ((g, gamma), x) in gradient.iter_mut().zip(gamma).zip(standard) {
        let gamma = simd.splat_f32s(*gamma);
        for v in 0..VECTORS {
            g[v] = simd.mul_f32s(g[v], gamma);
            mean[v] = simd.add_f32s(mean[v], g[v]);
            projection[v] = simd.mul_add_e_f32s(g[v], x[v], projection[v]);
        }
    }
    let count = simd.splat_f32s(1.0 / standard.len() as f32);
    for v in 0..VECTORS {
        mean[v] = simd.mul_f32s(mean[v], count);
        projection[v] = simd.mul_f32s(projection[v], count);
    }
    for (g, x) in gradient.iter_mut().zip(standard) {
        for v in 0..VECTORS {
            let inside = simd.sub_f32s(simd.sub_f32s(g[v], mean[v]), simd.mul_f32s(x[v], projection[v]));
            g[v] = simd.mul_f32s(inside, scale[v]);
        }
    }
}

/// Backward of the ReLU: nothing passes where a unit is 0.
#[inline(always)]
pub(super) fn mask<S: Simd>(simd: S, gradient: &mut [Row<S>], units: &[Row<S>]) {
    let zero = simd.splat_f32s(0.0);
    for (g, unit) in gradient.iter_mut().zip(units) {
        for v in 0..VECTORS {
            g[v] = simd.select_f32s(simd.greater_than_f32s(unit[v], zero), g[v], zero);
        }
    }
}

/// Adds the rows, their vectors together, to one vector each.
#[inline(always)]
pub(super) fn accumulate<S: Simd>(simd: S, rows: &[Row<S>], sums: &mut [S::f32s]) {
    for (sum, row) in sums.iter_mut().zip(rows) {
        *sum = simd.add_f32s(*sum, simd.add_f32s(row[0], simd.add_f32s(row[1], row[2])));
    }
}

/// Adds to each sum the products of a row of `a` and of `b`, their vectors together.
#[inline(always)]
pub(super) fn accumulate_products<S: Simd>(simd: S, a: &[Row<S>], b: &[Row<S>], sums: &mut [S::f32s]) {
    for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
        *sum = accumulate_product(simd, *sum, a, b);
    }
}

#[inline(always)]
pub(super) fn accumulate_product<S: Simd>(simd: S, sum: S::f32s, a: &Row<S>, b: &Row<S>) -> S::f32s {
    (0..VECTORS).fold(sum, |sum, v| simd.mul_add_e_f32s(a[v], b[v], sum))
}

/// Backward of the encoding: the gradient with respect to every directional input ⟨z, d⟩, given to `each` as the
/// input's index, the number of the vector in the row, and the vector.
#[inline(always)]
pub(super) fn unencode<S: Simd>(
    simd: S,
    inputs: std::ops::Range<usize>,
    features: &[Row<S>],
    gradient: &[Row<S>],
    mut each: impl FnMut(usize, usize, S::f32s),
) {
    let (features, _) = features.as_chunks::<5>();
    let (gradient, _) = gradient.as_chunks::<5>();
    let (slow, fast) = (simd.splat_f32s(TAU), simd.splat_f32s(4.0 * TAU));
    for ((j, [sin1, sin4, cos1, cos4, _]), [g_sin1, g_sin4, g_cos1, g_cos4, g]) in
        inputs.zip(features).zip(gradient)
    {
        for v in 0..VECTORS {
            let one = by_angle(simd, [g_sin1[v], g_cos1[v]], [sin1[v], cos1[v]]);
            let four = by_angle(simd, [g_sin4[v], g_cos4[v]], [sin4[v], cos4[v]]);
            each(j, v, simd.mul_add_e_f32s(one, slow, simd.mul_add_e_f32s(four, fast, g[v])));
        }
    }
}

/// Backward of (sin a, cos a), by a.
#[inline(always)]
fn by_angle<S: Simd>(simd: S, [g_sin, g_cos]: [S::f32s; 2], [sin, cos]: [S::f32s; 2]) -> S::f32s {
    simd.sub_f32s(simd.mul_f32s(g_sin, cos), simd.mul_f32s(g_cos, sin))
}
