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

    /// ∂P_c/∂(lobe) in the directions of a block, P_c their log radiance of colour `c`: [`Lobe::COORDINATES`] rows a lobe.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(all: &[Self], simd: S, direction: &[Row<S>], c: usize, rows: &mut [Row<S>]) {
        let zero = simd.splat_f32s(0.0);
        for (Self { lobe, tangents }, rows) in all.iter().zip(rows.as_chunks_mut::<{ Lobe::COORDINATES }>().0)
        {
            for v in 0..VECTORS {
                let d = [direction[0][v], direction[1][v], direction[2][v]];
                let exponent = lobes::exponent(simd, lobe, d);
                let gauss = math::exp(simd, exponent);
                let value = simd.mul_f32s(gauss, simd.splat_f32s(lobe.amplitude[c]));
                for (k, row) in rows[..3].iter_mut().enumerate() {
                    row[v] = if k == c { gauss } else { zero };
                }
                rows[3][v] = simd.mul_f32s(value, exponent);
                let steep = simd.mul_f32s(value, simd.splat_f32s(lobe.sharpness));
                for (row, tangent) in rows[4..].iter_mut().zip(tangents) {
                    let mut along = zero;
                    for (d, t) in d.into_iter().zip(tangent) {
                        along = simd.mul_add_e_f32s(d, simd.splat_f32s(*t), along);
                    }
                    row[v] = simd.mul_f32s(steep, along);
                }
            }
        }
    }
}
