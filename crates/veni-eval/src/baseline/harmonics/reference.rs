//! Spherical harmonics as the reference's baseline computes them, for their numbers only.
//!
//! There are two parts that do not agree with each other: the projection of an image samples pixel *corners* and counts
//! the azimuth along the columns; the field takes a direction of the camera frame (see
//! [`sphere::reference`](veni_light::sphere::reference)) and counts the azimuth from +y to +x.

use std::f64::consts::PI;

use super::{Basis, combine};
use veni_light::sphere::Equirect;

/// What stands for a pixel in the projection: the direction of its upper left corner, θ = πj/H and φ = 2πi/W.
#[doc(hidden)]
pub fn corner_directions(grid: Equirect) -> Vec<[f64; 3]> {
    let direction = |j: usize, i: usize| {
        let (sin_t, cos_t) = (PI * j as f64 / grid.height as f64).sin_cos();
        let (sin_p, cos_p) = (2.0 * PI * i as f64 / grid.width as f64).sin_cos();
        [sin_t * cos_p, sin_t * sin_p, cos_t]
    };
    (0..grid.len()).map(|p| direction(p / grid.width, p % grid.width)).collect()
}

/// x = Σ ω I Y at the pixel corners: a projection that takes the sampled basis for orthonormal. `image` is
/// `[height, width, 3]`, the result one coefficient per function and channel.
///
/// # Panics
/// If the image does not have W·H pixels.
pub fn project(grid: Equirect, image: &[[f32; 3]], order: usize) -> Vec<[f64; 3]> {
    assert_eq!(image.len(), grid.len(), "the pixels of a {} × {} image", grid.width, grid.height);
    let weighted = image.iter().enumerate().map(|(p, pixel)| {
        let weight = grid.solid_angle(p / grid.width);
        pixel.map(|v| weight * f64::from(v))
    });
    transposed(&Basis::new(order), &corner_directions(grid), weighted)
}

/// The image of an expansion, at the pixel corners.
///
/// # Panics
/// If the number of coefficients is not (order + 1)².
pub fn reconstruct(grid: Equirect, coefficients: &[[f64; 3]], order: usize) -> Vec<[f64; 3]> {
    evaluate(&Basis::new(order), &corner_directions(grid), coefficients)
}

/// The field at directions of the camera frame: θ = arccos d_z, φ = atan2(d_x, d_y). Its output is taken for log
/// radiance.
///
/// # Panics
/// If the number of coefficients is not (order + 1)².
pub fn field(directions: &[[f32; 3]], coefficients: &[[f64; 3]], order: usize) -> Vec<[f64; 3]> {
    evaluate(&Basis::new(order), &from_camera(directions), coefficients)
}

/// The gradient of Σ_d Σ_c `probe`·[`field`] in the coefficients.
///
/// # Panics
/// If there is not one probe per direction.
#[doc(hidden)]
pub fn field_gradient(directions: &[[f32; 3]], probe: &[[f64; 3]], order: usize) -> Vec<[f64; 3]> {
    assert_eq!(directions.len(), probe.len(), "one probe per direction");
    transposed(&Basis::new(order), &from_camera(directions), probe.iter().copied())
}

fn from_camera(directions: &[[f32; 3]]) -> Vec<[f64; 3]> {
    directions.iter().map(|&[x, y, z]| [y, x, z].map(f64::from)).collect()
}

fn evaluate(basis: &Basis, directions: &[[f64; 3]], coefficients: &[[f64; 3]]) -> Vec<[f64; 3]> {
    assert_eq!(coefficients.len(), basis.len(), "coefficients of spherical harmonics");
    basis.matrix(directions).chunks_exact(basis.len()).map(|row| combine(row, coefficients)).collect()
}

fn transposed(
    basis: &Basis,
    directions: &[[f64; 3]],
    values: impl Iterator<Item = [f64; 3]>,
) -> Vec<[f64; 3]> {
    let mut out = vec![[0.0; 3]; basis.len()];
    for (row, value) in basis.matrix(directions).chunks_exact(basis.len()).zip(values) {
        for (x, f) in out.iter_mut().zip(row) {
            x.iter_mut().zip(value).for_each(|(x, v)| *x += f * v);
        }
    }
    out
}
