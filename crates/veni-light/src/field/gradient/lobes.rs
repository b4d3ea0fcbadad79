//! The lobes' rows of the Jacobian of log radiance: closed forms, block by block. MODEL (82).

use pulp::Simd;

use crate::field::block::{Row, VECTORS};
use crate::field::{lobes, math};
use crate::latent::Lobe;

/// A lobe with the directions in which its middle moves.
#[derive(Debug)]
pub(super) struct LobeRows {
    lobe: Lobe,
    tangents: [[f32; 3]; 2],
}

impl LobeRows {
    pub(super) fn of(lobes: &[Lobe]) -> Vec<Self> {
        lobes.iter().map(|lobe| Self { lobe: *lobe, tangents: lobe.tangents() }).collect()
    }

    /// Coordinates of a lobe that a colour's log radiance depends on: that amplitude, ln s, the two angles.
    pub(super) const OF_COLOUR: usize = 4;

    /// Which coordinate of all lobes' the `k`th is that colour `c` depends on.
    pub(super) fn coordinate(k: usize, c: usize) -> usize {
        let (lobe, within) = (k / Self::OF_COLOUR, k % Self::OF_COLOUR);
        Lobe::COORDINATES * lobe + if within == 0 { c } else { within + 2 }
    }

    /// The [`shape`]s of a block, [`OF_COLOUR`](Self::OF_COLOUR) rows a lobe. The lobes are added to the log radiance `rgb`.
    #[inline(always)]
    pub(super) fn shapes<S: Simd>(
        all: &[Self],
        simd: S,
        direction: &[Row<S>],
        shapes: &mut [Row<S>],
        rgb: &mut [Row<S>],
    ) {
        for (Self { lobe, tangents }, shapes) in
            all.iter().zip(shapes.as_chunks_mut::<{ Self::OF_COLOUR }>().0)
        {
            for v in 0..VECTORS {
                let shape = shape(simd, lobe, tangents, direction, v);
                let gauss = shape[0];
                shapes.iter_mut().zip(shape).for_each(|(row, shape)| row[v] = shape);
                for (row, amplitude) in rgb.iter_mut().zip(lobe.amplitude) {
                    row[v] = simd.mul_add_e_f32s(simd.splat_f32s(amplitude), gauss, row[v]);
                }
            }
        }
    }

    /// ∂P_c/∂(what colour `c` depends on), from the shapes.
    #[inline(always)]
    pub(super) fn of_colour<S: Simd>(
        all: &[Self],
        simd: S,
        shapes: &[Row<S>],
        c: usize,
        rows: &mut [Row<S>],
    ) {
        let lobes = all.iter().zip(shapes.as_chunks().0).zip(rows.as_chunks_mut::<{ Self::OF_COLOUR }>().0);
        for ((Self { lobe, .. }, shapes), rows) in lobes {
            let shapes: &[Row<S>; Self::OF_COLOUR] = shapes;
            rows[0] = shapes[0];
            let amplitude = simd.splat_f32s(lobe.amplitude[c]);
            for (row, shape) in rows[1..].iter_mut().zip(&shapes[1..]) {
                for v in 0..VECTORS {
                    row[v] = simd.mul_f32s(shape[v], amplitude);
                }
            }
        }
    }

    /// ∂P_c/∂(lobe) in the directions of a block, P_c their log radiance of colour `c`: [`Lobe::COORDINATES`] rows a lobe.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(all: &[Self], simd: S, direction: &[Row<S>], c: usize, rows: &mut [Row<S>]) {
        let zero = simd.splat_f32s(0.0);
        for (Self { lobe, tangents }, rows) in all.iter().zip(rows.as_chunks_mut::<{ Lobe::COORDINATES }>().0)
        {
            for v in 0..VECTORS {
                let [gauss, rest @ ..] = shape(simd, lobe, tangents, direction, v);
                for (k, row) in rows[..3].iter_mut().enumerate() {
                    row[v] = if k == c { gauss } else { zero };
                }
                let amplitude = simd.splat_f32s(lobe.amplitude[c]);
                for (row, shape) in rows[3..].iter_mut().zip(rest) {
                    row[v] = simd.mul_f32s(shape, amplitude);
                }
            }
        }
    }
}

/// What the rows of all colours share, in the directions of vector `v`: e^{s(⟨d,u⟩ − 1)}, that by the exponent, and that by s
/// times the tangents' part of d.
#[inline(always)]
fn shape<S: Simd>(
    simd: S,
    lobe: &Lobe,
    tangents: &[[f32; 3]; 2],
    direction: &[Row<S>],
    v: usize,
) -> [S::f32s; LobeRows::OF_COLOUR] {
    let d = [direction[0][v], direction[1][v], direction[2][v]];
    let exponent = lobes::exponent(simd, lobe, d);
    let gauss = math::exp(simd, exponent);
    let steep = simd.mul_f32s(gauss, simd.splat_f32s(lobe.sharpness));
    let [along, upwards] = tangents.each_ref().map(|tangent| simd.mul_f32s(steep, along(simd, d, tangent)));
    [gauss, simd.mul_f32s(gauss, exponent), along, upwards]
}

/// ⟨d, t⟩.
#[inline(always)]
fn along<S: Simd>(simd: S, d: [S::f32s; 3], tangent: &[f32; 3]) -> S::f32s {
    let mut along = simd.splat_f32s(0.0);
    for (d, t) in d.into_iter().zip(tangent) {
        along = simd.mul_add_e_f32s(d, simd.splat_f32s(*t), along);
    }
    along
}
