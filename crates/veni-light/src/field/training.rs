//! What only training calls: the decoder for a batch of latents with gradients with respect to its weights, and matrix
//! products in bfloat16.

pub use super::bfloat16::Bfloat16;
pub use super::gradient::perceptron::{Conditioned, ConditionedGradient, Gradients, Perceptron};
