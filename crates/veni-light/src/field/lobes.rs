//! Spherical Gaussians added to the network's output. MODEL (71).

use pulp::{Simd, bytemuck};

use super::block::{Row, VECTORS};
use super::math;
use crate::latent::Lobe;

/// Adds every lobe to the three rows of log radiance of a block. The exponent is taken from the chord, s(⟨d,u⟩ − 1) =
/// −½ s |d − u|², which does not cancel where a sharp lobe is high.
#[inline(always)]
pub(super) fn add<S: Simd>(simd: S, lobes: &[Lobe], direction: &[Row<S>], rgb: &mut [Row<S>]) {
    for lobe in lobes {
        for v in 0..VECTORS {
            let gauss = gauss(simd, lobe, [direction[0][v], direction[1][v], direction[2][v]]);
            for (row, amplitude) in rgb.iter_mut().zip(lobe.amplitude) {
                row[v] = simd.mul_add_e_f32s(simd.splat_f32s(amplitude), gauss, row[v]);
            }
        }
    }
}

/// The same to one direction's, to the bit.
#[inline(always)]
pub(super) fn add_one<S: Simd>(simd: S, lobes: &[Lobe], direction: [f32; 3], rgb: &mut [f32; 3]) {
    let direction = direction.map(|c| simd.splat_f32s(c));
    for lobe in lobes {
        let gauss = gauss(simd, lobe, direction);
        for (value, amplitude) in rgb.iter_mut().zip(lobe.amplitude) {
            let sum = simd.mul_add_e_f32s(simd.splat_f32s(amplitude), gauss, simd.splat_f32s(*value));
            *value = first(sum);
        }
    }
}

#[inline(always)]
fn gauss<S: Simd>(simd: S, lobe: &Lobe, direction: [S::f32s; 3]) -> S::f32s {
    math::exp(simd, exponent(simd, lobe, direction))
}

/// s(⟨d,u⟩ − 1).
#[inline(always)]
pub(super) fn exponent<S: Simd>(simd: S, lobe: &Lobe, direction: [S::f32s; 3]) -> S::f32s {
    let mut square = simd.splat_f32s(0.0);
    for (d, u) in direction.into_iter().zip(lobe.direction) {
        let difference = simd.sub_f32s(d, simd.splat_f32s(u));
        square = simd.mul_add_e_f32s(difference, difference, square);
    }
    simd.mul_f32s(square, simd.splat_f32s(-0.5 * lobe.sharpness))
}

#[inline(always)]
pub(super) fn first<V: bytemuck::Pod>(vector: V) -> f32 {
    bytemuck::cast_slice::<V, f32>(&[vector])[0]
}
