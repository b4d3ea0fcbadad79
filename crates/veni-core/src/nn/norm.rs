//! Lengths of vectors, safe at zero.
//!
//! √s has an infinite derivative at 0, and 0 · ∞ is NaN; masking the result afterwards does not help. Here s is
//! clamped *before* the root: below the clamp the gradient is cut, which gives a norm its customary subgradient
//! 0 at the origin.

use burn::tensor::Tensor;

/// The axis of coordinates in a vector feature.
pub(crate) const COORDINATE: usize = 2;

/// Smallest square a length is taken of: just above f32's smallest normal number, so that a length is never
/// below 1.1e-19.
const SMALLEST_SQUARE: f64 = 1.2e-38;

/// Σ x² over the coordinates.
///
/// # Shapes
/// - `x`: `[batch, token, coordinate, channel]`
/// - output: `[batch, token, 1, channel]`
pub fn squared_coordinate_norm(x: Tensor<4>) -> Tensor<4> {
    (x.clone() * x).sum_dim(COORDINATE)
}

/// √(Σ x²) over the coordinates, with value (almost) 0 and gradient 0 at the origin.
///
/// # Shapes
/// - `x`: `[batch, token, coordinate, channel]`
/// - output: `[batch, token, 1, channel]`
pub fn coordinate_norm(x: Tensor<4>) -> Tensor<4> {
    squared_coordinate_norm(x).clamp_min(SMALLEST_SQUARE).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn value_and_gradient_at_and_near_zero() {
        let device = Device::flex().autodiff();
        // channels: origin, 3-4-5 triangle, tiny, below f32's smallest square
        let x = Tensor::<4>::from_floats([[[[0.0, 3.0, 3e-15, 1e-30], [0.0, 4.0, 4e-15, 0.0]]]], &device)
            .require_grad();
        let n = coordinate_norm(x.clone());
        let value: Vec<f32> = n.clone().try_into_vec_as().unwrap();
        assert!(value[0] < 1e-18 && (value[1] - 5.0).abs() < 1e-6);
        assert!((value[2] / 5e-15 - 1.0).abs() < 1e-5 && value[3] < 1e-18);
        let gradient: Vec<f32> = x.grad(&n.sum().backward()).unwrap().try_into_vec_as().unwrap();
        let expected = [0.0, 0.6, 0.6, 0.0, 0.0, 0.8, 0.8, 0.0];
        for (g, e) in gradient.iter().zip(expected) {
            assert!((g - e).abs() < 1e-5, "{gradient:?}");
        }
    }
}
