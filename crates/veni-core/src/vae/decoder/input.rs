//! The directional input: products of latent and direction, encoded by sines. MODEL (16).

use burn::tensor::{Tensor, TensorData};
use std::f32::consts::TAU;
use veni_light::model::Equivariance;

/// Frequencies of the encoding.
const FREQUENCIES: [f32; 2] = [1.0, 4.0];

/// (d_x, d_y, d_z, |d_xy|, 1) of directions [.., R, 3]: everything the input is linear in.
///
/// Directions are constants: no gradient flows to them (that of |d_xy| has no value at the poles).
pub(super) fn basis(directions: Tensor<3>) -> Tensor<3> {
    let directions = directions.detach();
    let xy = directions.clone().narrow(2, 0, 2);
    let radius = (xy.clone() * xy).sum_dim(2).sqrt();
    let one = radius.ones_like();
    Tensor::cat(vec![directions, radius, one], 2)
}

/// The directional input x as a linear function of [`basis`]: latents [B, N, 3] → [B, 5, m].
///
/// Under SO(2) x has m = N + 2 components: z_i,xy · d_xy for every latent vector, d_z and |d_xy|. Otherwise it
/// has N: z_i · d.
pub(super) fn products(equivariance: Equivariance, latent: Tensor<3>) -> Tensor<3> {
    let [batch, n, _] = latent.dims();
    let device = latent.device();
    if equivariance != Equivariance::So2 {
        return Tensor::cat(vec![latent.swap_dims(1, 2), Tensor::zeros([batch, 2, n], &device)], 1);
    }
    let m = n + 2;
    // Rows d_x, d_y: the latents; rows d_z, |d_xy|: copied to the last two columns; row 1: nothing.
    let products = latent.narrow(2, 0, 2).swap_dims(1, 2);
    let products = Tensor::cat(vec![products, Tensor::zeros([batch, 2, 2], &device)], 2);
    let mut copies = vec![0.0f32; 3 * m];
    (copies[n], copies[m + n + 1]) = (1.0, 1.0);
    let copies: Tensor<3> = Tensor::from_data(TensorData::new(copies, [1, 3, m]), &device);
    Tensor::cat(vec![products, copies.expand([batch, 3, m])], 1)
}

/// The first linear map applied to the (encoded) directional input, plus an offset per image.
///
/// The encoding of x is [sin 2πfx (2m, frequency fastest) | sin(2πfx + π/2) | x]. All of it but the sine is
/// linear in [`basis`], so one matrix K [B, 5, 4m] per image gives every argument, phase included, in one
/// product, and the raw part and the offset are one product with a [5, h] matrix.
///
/// `products` [B, 5, m], basis [1 or B, R, 5], offset [1 or B, h] → [B, R, h]. The weight is [5m, h] for an
/// encoded input, [m, h] for a plain one.
pub(super) fn project(
    weight: Tensor<2>,
    products: Tensor<3>,
    basis: Tensor<3>,
    offset: Tensor<2>,
) -> Tensor<3> {
    let [batch, _, m] = products.dims();
    let [_, rays, _] = basis.dims();
    let (device, [inputs, hidden]) = (products.device(), weight.dims());
    let one: Tensor<3> = Tensor::from_data([[[0.0f32], [0.0], [0.0], [0.0], [1.0]]], &device);
    let linear = |weight: Tensor<2>, offset: Tensor<2>| {
        let linear = products.clone().matmul(weight.unsqueeze()) + one.clone() * offset.unsqueeze_dim(1);
        basis.clone().matmul(linear)
    };
    if inputs == m {
        return linear(weight, offset);
    }
    let frequencies: Tensor<4> = Tensor::from_data([[[FREQUENCIES]]], &device);
    let turns = (products.clone().unsqueeze_dim::<4>(3) * frequencies).reshape([batch, 5, 2 * m]);
    let turns = Tensor::cat(vec![turns.clone(), turns + one.clone() * 0.25], 2);
    let waves = sine_of_turns(basis.clone().matmul(turns)).reshape([batch * rays, 4 * m]);
    let linear = linear(weight.clone().narrow(0, 4 * m, m), offset);
    waves.matmul(weight.narrow(0, 0, 4 * m)).reshape([batch, rays, hidden]) + linear
}

/// The encoding of plain numbers, over the last axis: x [B, T, w] →
/// [sin 2πfx (2w, frequency fastest) | sin(2πfx + π/2) | x] [B, T, 5w].
pub(super) fn encode(x: Tensor<3>) -> Tensor<3> {
    let [batch, tokens, width] = x.dims();
    let frequencies: Tensor<4> = Tensor::from_data([[[FREQUENCIES]]], &x.device());
    let turns = (x.clone().unsqueeze_dim::<4>(3) * frequencies).reshape([batch, tokens, 2 * width]);
    Tensor::cat(vec![sine_of_turns(turns.clone()), sine_of_turns(turns + 0.25), x], 2)
}

/// sin 2πt. The argument reaches tens of turns; the sine has period 1 in turns, and t − round(t) is exact.
fn sine_of_turns(turns: Tensor<3>) -> Tensor<3> {
    let whole = turns.clone().detach().round();
    ((turns - whole) * TAU).sin()
}
