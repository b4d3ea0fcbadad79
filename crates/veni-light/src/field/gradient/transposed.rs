//! The matrices of the network the other way round.

use crate::field::mlp::{Matrix, Mlp};

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
    pub(in crate::field) fn new(mlp: &Mlp) -> Self {
        let hidden = mlp.hidden;
        Self {
            input: mlp.input.iter().map(|chunk| chunk.weight.transposed(hidden)).collect(),
            layers: (mlp.layers.iter())
                .map(|layer| [layer.ff1.transposed(hidden), layer.ff2.transposed(hidden)])
                .collect(),
            output: mlp.output.transposed(3),
        }
    }
}
