//! The matrices of the network the other way round.

use crate::field::weights::{Matrix, Weights};

/// Transposes of the matrices that a gradient runs through.
#[derive(Debug)]
pub(in crate::field) struct Transposed {
    /// One per chunk of directional inputs: [h, 5 · inputs].
    pub(super) input: Vec<Matrix>,
    /// (first, second) feed-forward map of every layer.
    pub(super) layers: Vec<[Matrix; 2]>,
    /// [3, h].
    pub(super) output: Matrix,
}

impl Transposed {
    pub(in crate::field) fn new(weights: &Weights) -> Self {
        let hidden = weights.hidden;
        Self {
            input: weights.input.iter().map(|chunk| chunk.weight.transposed(hidden)).collect(),
            layers: (weights.layers.iter())
                .map(|layer| [layer.ff1.transposed(hidden), layer.ff2.transposed(hidden)])
                .collect(),
            output: weights.output.transposed(3),
        }
    }
}
