//! The kernels for AVX512-BF16.
//!
//! Everything in here is safe code but for three calls: a function that is compiled for instructions which not every
//! processor has may only be called where they are known to exist. [`Bfloat16`] is that knowledge.

#![allow(
    unsafe_code,
    reason = "calls of functions with target features, each behind the token of their detection"
)]

use std::arch::x86_64::{
    __m256bh, __m512, __m512bh, __m512i, _mm512_add_ps, _mm512_cvtne2ps_pbh, _mm512_cvtneps_pbh,
    _mm512_dpbf16_ps, _mm512_max_ps, _mm512_permutexvar_epi16, _mm512_set1_epi32, _mm512_set1_ps,
    _mm512_setzero_ps,
};

use super::{Bfloat16, LANES, Pairs, Row, Wide, WidePairs};
use crate::field::block::VECTORS;
use crate::field::mlp::PANEL;

/// Pairs of inputs that are rounded at a time: 12 KB of them, which stay in the first-level cache.
const AT_ONCE: usize = 64;
/// Pairs of directions of a block.
const DIRECTIONS: usize = VECTORS * LANES / 2;
/// Inputs of a register tile of the sums: 16 sums, 2 vectors of gradients, and numbers of x from memory.
const ROWS: usize = 8;

/// Two rows' directions, lane by lane in pairs.
type RowPairs = [[u32; LANES]; VECTORS];

/// Whether the instructions are there, and blocks are as wide as they take them.
pub(super) fn detected() -> bool {
    pulp::x86::V4::try_new().is_some()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bf16")
}

pub(super) fn product<const ADD: bool, const RELU: bool>(
    matrix: &Pairs,
    bias: &[[f32; PANEL]],
    x: &[Row],
    y: &mut [[Row; PANEL]],
) {
    let Bfloat16(()) = matrix.token;
    // SAFETY: a token exists only where `detected`, which asks for the same features.
    unsafe { panels::<ADD, RELU>(matrix, bias, x, y) }
}

pub(super) fn transpose(_token: Bfloat16, rows: &[Row], out: &mut [WidePairs]) {
    // SAFETY: as in `product`.
    unsafe { transpose_pairs(rows, out) }
}

pub(super) fn add(_token: Bfloat16, x: &[Row], gradient: &[WidePairs], sums: &mut [Wide]) {
    // SAFETY: as in `product`.
    unsafe { outer(x, gradient, sums) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn panels<const ADD: bool, const RELU: bool>(
    matrix: &Pairs,
    bias: &[[f32; PANEL]],
    x: &[Row],
    y: &mut [[Row; PANEL]],
) {
    let mut rounded = [RowPairs::default(); AT_ONCE];
    let parts = matrix.pairs.div_ceil(AT_ONCE);
    for (part, x) in x.chunks(2 * AT_ONCE).enumerate() {
        let rounded = &mut rounded[..x.len().div_ceil(2)];
        interleave(x, rounded);
        let (first, last) = (part == 0, part + 1 == parts);
        let panels = matrix.words.chunks_exact(matrix.pairs);
        for ((panel, bias), y) in panels.zip(bias).zip(y.iter_mut()) {
            let weights = &panel[part * AT_ONCE..][..rounded.len()];
            tile(weights, first.then_some(bias), rounded, y, [ADD || !first, RELU && last]);
        }
    }
}

/// Rows 2k and 2k + 1, lane by lane in pairs.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn interleave(x: &[Row], out: &mut [RowPairs]) {
    // of 32 numbers, 16 of the first row and 16 of the second
    let order: [u16; 2 * LANES] = std::array::from_fn(|i| (i / 2 + i % 2 * LANES) as u16);
    let order: __m512i = bytemuck::cast(order);
    for (rows, out) in x.chunks(2).zip(out) {
        for v in 0..VECTORS {
            let second = rows.get(1).map_or(_mm512_setzero_ps(), |row| bytemuck::cast(row[v]));
            let both: __m512bh = _mm512_cvtne2ps_pbh(second, bytemuck::cast(rows[0][v]));
            out[v] = bytemuck::cast(_mm512_permutexvar_epi16(order, bytemuck::cast(both)));
        }
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
#[inline]
fn tile(
    weights: &[[u32; PANEL]],
    bias: Option<&[f32; PANEL]>,
    x: &[RowPairs],
    y: &mut [Row; PANEL],
    [add, relu]: [bool; 2],
) {
    let mut sums = [[_mm512_setzero_ps(); VECTORS]; PANEL];
    for i in 0..PANEL {
        let bias = bias.map_or(_mm512_setzero_ps(), |bias| _mm512_set1_ps(bias[i]));
        for v in 0..VECTORS {
            sums[i][v] = if add { _mm512_add_ps(bias, bytemuck::cast(y[i][v])) } else { bias };
        }
    }
    for (weights, x) in weights.iter().zip(x) {
        let x: [__m512bh; VECTORS] = [bytemuck::cast(x[0]), bytemuck::cast(x[1]), bytemuck::cast(x[2])];
        for i in 0..PANEL {
            let w: __m512bh = bytemuck::cast(_mm512_set1_epi32(weights[i] as i32));
            for v in 0..VECTORS {
                sums[i][v] = _mm512_dpbf16_ps(sums[i][v], w, x[v]);
            }
        }
    }
    for i in 0..PANEL {
        for v in 0..VECTORS {
            let sum = if relu { _mm512_max_ps(sums[i][v], _mm512_setzero_ps()) } else { sums[i][v] };
            y[i][v] = bytemuck::cast(sum);
        }
    }
}

/// A row's directions in pairs.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
#[inline]
fn round(row: &Row) -> [u32; DIRECTIONS] {
    let most: __m512bh = _mm512_cvtne2ps_pbh(bytemuck::cast(row[1]), bytemuck::cast(row[0]));
    let rest: __m256bh = _mm512_cvtneps_pbh(bytemuck::cast(row[2]));
    let mut out = [0; DIRECTIONS];
    out[..LANES].copy_from_slice(&bytemuck::cast::<__m512bh, [u32; LANES]>(most));
    out[LANES..].copy_from_slice(&bytemuck::cast::<__m256bh, [u32; LANES / 2]>(rest));
    out
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn transpose_pairs(rows: &[Row], out: &mut [WidePairs]) {
    for (rows, panel) in rows.chunks(2 * LANES).zip(out.chunks_exact_mut(DIRECTIONS)) {
        for (o, row) in rows.iter().enumerate() {
            for (pair, out) in round(row).into_iter().zip(panel.iter_mut()) {
                out[o / LANES][o % LANES] = pair;
            }
        }
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
fn outer(x: &[Row], gradient: &[WidePairs], sums: &mut [Wide]) {
    let mut rounded = [[0; DIRECTIONS]; 2 * AT_ONCE];
    for (part, rows) in x.chunks(2 * AT_ONCE).enumerate() {
        let rounded = &mut rounded[..rows.len()];
        for (out, row) in rounded.iter_mut().zip(rows) {
            *out = round(row);
        }
        for (gradient, sums) in gradient.chunks_exact(DIRECTIONS).zip(sums.chunks_exact_mut(x.len())) {
            let sums = &mut sums[2 * AT_ONCE * part..][..rows.len()];
            let (tiles, rest) = rounded.as_chunks::<ROWS>();
            let (tile_sums, rest_sums) = sums.as_chunks_mut::<ROWS>();
            for (x, sums) in tiles.iter().zip(tile_sums) {
                outer_tile(x, gradient, sums);
            }
            for (x, sums) in rest.as_chunks::<1>().0.iter().zip(rest_sums.as_chunks_mut::<1>().0) {
                outer_tile(x, gradient, sums);
            }
        }
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512bf16")]
#[inline]
fn outer_tile<const N: usize>(x: &[[u32; DIRECTIONS]; N], gradient: &[WidePairs], sums: &mut [Wide; N]) {
    let gradient = &gradient[..DIRECTIONS];
    let mut tile: [[__m512; 2]; N] = [[_mm512_setzero_ps(); 2]; N];
    for i in 0..N {
        tile[i] = [bytemuck::cast(sums[i][0]), bytemuck::cast(sums[i][1])];
    }
    for pair in 0..DIRECTIONS {
        let g: [__m512bh; 2] = [bytemuck::cast(gradient[pair][0]), bytemuck::cast(gradient[pair][1])];
        for i in 0..N {
            let x: __m512bh = bytemuck::cast(_mm512_set1_epi32(x[i][pair] as i32));
            for v in 0..2 {
                tile[i][v] = _mm512_dpbf16_ps(tile[i][v], x, g[v]);
            }
        }
    }
    for i in 0..N {
        sums[i] = [bytemuck::cast(tile[i][0]), bytemuck::cast(tile[i][1])];
    }
}
