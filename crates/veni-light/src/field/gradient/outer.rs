//! Sums over directions of outer products x gᵀ: the gradient with respect to a matrix [in, out].
//!
//! Activations lie feature by feature, a lane per direction, which suits a product with a matrix and not a sum over
//! directions. So the gradient g of a block is transposed (direction by direction), and x is read as it lies,
//! one number against two vectors of g. A register tile of 8 × 2 vectors (4 × 2 where there are 16 registers) runs
//! over the directions of the block.

use pulp::Simd;

use crate::field::bfloat16::Bfloat16;
use crate::field::block::{Row, VECTORS};

/// Vectors of outputs per panel.
const WIDE: usize = 2;

/// Outputs of a panel for one direction, or of a sum for one input.
pub(super) type Wide<S> = [<S as Simd>::f32s; WIDE];

/// Panels for this many outputs.
pub(super) fn panels<S: Simd>(outputs: usize) -> usize {
    outputs.div_ceil(WIDE * S::F32_LANES)
}

/// Directions of a block.
pub(super) fn lanes<S: Simd>() -> usize {
    VECTORS * S::F32_LANES
}

/// A block's gradient, transposed.
pub(super) struct Outer<'a, S: Simd> {
    transposed: &'a [Wide<S>],
    bfloat16: Option<Bfloat16>,
}

impl<'a, S: Simd> Outer<'a, S> {
    /// The rows of a gradient into `workspace`, panel by panel, in each direction by direction. What `workspace` holds
    /// beyond the last row stays.
    #[inline(always)]
    pub(super) fn new(bfloat16: Option<Bfloat16>, rows: &[Row<S>], workspace: &'a mut [Wide<S>]) -> Self {
        match bfloat16 {
            None => transpose::<S>(rows, workspace),
            Some(token) => token.transpose(bytemuck::cast_slice(rows), bytemuck::cast_slice_mut(workspace)),
        }
        Self { transposed: workspace, bfloat16 }
    }

    /// Adds x gᵀ of a block to `sums`, which lie panel by panel, in each input by input.
    #[inline(always)]
    pub(super) fn add(&self, simd: S, x: &[Row<S>], sums: &mut [Wide<S>]) {
        match self.bfloat16 {
            None => add(simd, x, self.transposed, sums),
            Some(token) => {
                let [x, transposed] = [x.as_flattened(), self.transposed.as_flattened()];
                token.add(
                    bytemuck::cast_slice(x),
                    bytemuck::cast_slice(transposed),
                    bytemuck::cast_slice_mut(sums),
                );
            }
        }
    }
}

#[inline(always)]
pub(super) fn transpose<S: Simd>(rows: &[Row<S>], out: &mut [Wide<S>]) {
    let (lanes, wide) = (lanes::<S>(), WIDE * S::F32_LANES);
    let flat: &[f32] = bytemuck::cast_slice(rows.as_flattened());
    let out: &mut [f32] = bytemuck::cast_slice_mut(out.as_flattened_mut());
    for (rows, panel) in flat.chunks(wide * lanes).zip(out.chunks_exact_mut(wide * lanes)) {
        for (o, row) in rows.chunks_exact(lanes).enumerate() {
            for (lane, value) in row.iter().enumerate() {
                panel[lane * wide + o] = *value;
            }
        }
    }
}

#[inline(always)]
pub(super) fn add<S: Simd>(simd: S, x: &[Row<S>], gradient: &[Wide<S>], sums: &mut [Wide<S>]) {
    let lanes = lanes::<S>();
    let flat: &[f32] = bytemuck::cast_slice(x.as_flattened());
    for (gradient, sums) in gradient.chunks_exact(lanes).zip(sums.chunks_exact_mut(x.len())) {
        // 16 sums and 2 vectors of g, or 8 and 2, and a number of x
        let rest = if S::REGISTER_COUNT >= 32 {
            tiles::<S, 8>(simd, flat, gradient, sums)
        } else {
            tiles::<S, 4>(simd, flat, gradient, sums)
        };
        tiles::<S, 1>(simd, &flat[rest * lanes..], gradient, &mut sums[rest..]);
    }
}

/// Whole tiles of ROWS inputs; returns how many inputs they cover.
#[inline(always)]
fn tiles<S: Simd, const ROWS: usize>(simd: S, x: &[f32], g: &[Wide<S>], sums: &mut [Wide<S>]) -> usize {
    let (tiles, _) = sums.as_chunks_mut::<ROWS>();
    let covered = tiles.len() * ROWS;
    for (x, sums) in x.chunks_exact(ROWS * lanes::<S>()).zip(tiles) {
        tile(simd, x, g, sums);
    }
    covered
}

#[inline(always)]
fn tile<S: Simd, const ROWS: usize>(simd: S, x: &[f32], g: &[Wide<S>], sums: &mut [Wide<S>; ROWS]) {
    let lanes = lanes::<S>();
    // lengths that the compiler knows, so that no access below is checked
    let (x, g) = (&x[..ROWS * lanes], &g[..lanes]);
    let mut tile = *sums;
    for lane in 0..lanes {
        for i in 0..ROWS {
            let x = simd.splat_f32s(x[i * lanes + lane]);
            for v in 0..WIDE {
                tile[i][v] = simd.mul_add_e_f32s(x, g[lane][v], tile[i][v]);
            }
        }
    }
    *sums = tile;
}

/// Row `input` of sums for `inputs` inputs, its first outputs, added to `out`.
pub(super) fn read<S: Simd>(sums: &[Wide<S>], inputs: usize, input: usize, out: &mut [f32]) {
    let panels = sums.chunks_exact(inputs);
    for (panel, out) in panels.zip(out.chunks_mut(WIDE * S::F32_LANES)) {
        let values: &[f32] = bytemuck::cast_slice(&panel[input]);
        for (out, value) in out.iter_mut().zip(values) {
            *out += value;
        }
    }
}
