//! Equivariant layers on burn, one per file.
//!
//! A **vector feature** is a tensor `[batch, token, coordinate, channel]`: every channel of a token holds one
//! vector of 2 to 6 coordinates. With channels last a Vector-Neuron linear map is one plain matrix product.
//! Coordinates 0 and 1 are x and y, on which SO(2) acts; the others (z, and the colours r, g, b) are invariant.
//!
//! [`VnLinear`], [`VnRelu`] and [`VnLayerNorm`] never mix coordinates and commute with every orthogonal map of
//! them. [`So2Linear`] and [`So2Relu`] mix invariant into equivariant coordinates and back, and commute with
//! rotations and reflections of x, y. [`VectorLinear`] is either; attention, feed-forward and transformer are
//! built on it, so that each exists once.
//!
//! Weights are stored `[in, out]` (y = x W on row vectors) and initialised from the caller's generator, so that
//! a seed fixes a model on every device.

mod attention;
mod feed_forward;
mod init;
mod norm;
mod so2_linear;
mod so2_relu;
mod transformer;
mod vector_linear;
mod vn_invariant;
mod vn_layer_norm;
mod vn_linear;
mod vn_relu;

pub use attention::{VectorAttention, VectorAttentionConfig};
pub use feed_forward::{GateWeights, VectorFeedForward, VectorFeedForwardConfig};
pub use init::{normal, uniform};
pub use norm::{coordinate_norm, squared_coordinate_norm};
pub use so2_linear::{So2Linear, So2LinearConfig};
pub use so2_relu::So2Relu;
pub use transformer::{FoldedGates, VectorBlock, VectorTransformer, VectorTransformerConfig};
pub use vector_linear::{VectorLinear, VectorLinearConfig};
pub use vn_invariant::{VnInvariant, VnInvariantConfig};
pub use vn_layer_norm::{VnLayerNorm, VnLayerNormConfig};
pub use vn_linear::{VnLinear, VnLinearConfig};
pub use vn_relu::{VnRelu, VnReluConfig, vn_relu};

#[cfg(test)]
pub(crate) mod testing;
