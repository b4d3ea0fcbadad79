//! The directional input: products of latent and direction, encoded by sines.

use super::linear::Linear;
use burn::tensor::{Tensor, TensorData};
use std::f32::consts::TAU;

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

/// The first linear map applied to the encoded input, plus an offset per image.
///
/// The raw input x has m = N + 2 components: z_i,xy · d_xy for every latent vector, d_z and |d_xy|. The
/// encoding is [sin 2πfx (2m, frequency fastest) | sin(2πfx + π/2) | x]. All of it but the sine is linear
/// in [`basis`], so one matrix K [B, 5, 4m] per image gives every argument, phase included, in one
/// product, and the raw part and the bias are one product with a [5, h] matrix.
///
/// Latents [B, N, 3], basis [1 or B, R, 5], offset [B, h] → [B, R, h]. The weight is [5m, h].
pub(super) fn encode(input: &Linear, latent: Tensor<3>, basis: Tensor<3>, offset: Tensor<2>) -> Tensor<3> {
    let [batch, n, _] = latent.dims();
    let [_, rays, _] = basis.dims();
    let (m, device) = (n + 2, latent.device());
    let weight = input.weight.val();
    let hidden = weight.dims()[1];

    // Rows d_x, d_y: the latents; rows d_z, |d_xy|: copied to the last two columns; row 1: nothing.
    let products = latent.narrow(2, 0, 2).swap_dims(1, 2);
    let products = Tensor::cat(vec![products, Tensor::zeros([batch, 2, 2], &device)], 2);
    let mut copies = vec![0.0f32; 3 * m];
    (copies[n], copies[m + n + 1]) = (1.0, 1.0);
    let copies: Tensor<3> = Tensor::from_data(TensorData::new(copies, [1, 3, m]), &device);
    let raw = Tensor::cat(vec![products, copies.expand([batch, 3, m])], 1);
    let one: Tensor<3> = Tensor::from_data([[[0.0f32], [0.0], [0.0], [0.0], [1.0]]], &device);

    let frequencies: Tensor<4> = Tensor::from_data([[[FREQUENCIES]]], &device);
    let turns = (raw.clone().unsqueeze_dim::<4>(3) * frequencies).reshape([batch, 5, 2 * m]);
    let turns = Tensor::cat(vec![turns.clone(), turns + one.clone() * 0.25], 2);
    let turns = basis.clone().matmul(turns);
    // The argument reaches tens of turns; the sine has period 1 in turns, and x − round(x) is exact.
    let whole = turns.clone().detach().round();
    let waves = ((turns - whole) * TAU).sin().reshape([batch * rays, 4 * m]);

    let offset = (offset + input.bias.val().unsqueeze()).unsqueeze_dim(1);
    let linear = raw.matmul(weight.clone().narrow(0, 4 * m, m).unsqueeze()) + one * offset;
    waves.matmul(weight.narrow(0, 0, 4 * m)).reshape([batch, rays, hidden]) + basis.matmul(linear)
}
