//! Either linear layer behind one name.

use super::{So2Linear, So2LinearConfig, VnLinear, VnLinearConfig};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use veni_light::model::VectorLayer;
use veni_light::random::Stream;

/// Sizes of a [`VectorLinear`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorLinearConfig {
    /// Which layer.
    pub layer: VectorLayer,
    /// Channels that come in.
    pub input: usize,
    /// Channels that go out.
    pub output: usize,
    /// Coordinates that come in, x and y included.
    pub coordinates_in: usize,
    /// Coordinates that go out; a Vector-Neuron layer cannot change their number.
    pub coordinates_out: usize,
}

/// A linear map of vector features: Vector Neurons or SO(2).
#[derive(Module, Debug)]
pub enum VectorLinear {
    /// Coordinates are never mixed.
    Vn(VnLinear),
    /// Equivariant and invariant coordinates feed each other.
    So2(So2Linear),
}

impl VectorLinearConfig {
    /// A layer that keeps the number of coordinates.
    pub fn new(layer: VectorLayer, input: usize, output: usize, coordinates: usize) -> Self {
        Self { layer, input, output, coordinates_in: coordinates, coordinates_out: coordinates }
    }

    /// Draws the weights.
    ///
    /// # Panics
    /// If a Vector-Neuron layer is to change the number of coordinates, or an SO(2) layer has fewer than three.
    pub fn init(&self, rng: &mut Stream, device: &Device) -> VectorLinear {
        let Self { layer, input, output, coordinates_in, coordinates_out } = *self;
        match layer {
            VectorLayer::Vn => {
                assert_eq!(coordinates_in, coordinates_out, "a Vector-Neuron layer keeps the coordinates");
                VectorLinear::Vn(VnLinearConfig::new(input, output).init(rng, device))
            }
            VectorLayer::So2 => {
                assert!(
                    coordinates_in > 2 && coordinates_out > 2,
                    "an SO(2) layer has x, y and an invariant"
                );
                let (invariants_in, invariants_out) = (coordinates_in - 2, coordinates_out - 2);
                let config = So2LinearConfig { input, output, invariants_in, invariants_out };
                VectorLinear::So2(config.init(rng, device))
            }
        }
    }
}

impl VectorLinear {
    /// Applies the layer.
    ///
    /// # Shapes
    /// - `x`: `[batch, token, coordinates in, input]`
    /// - output: `[batch, token, coordinates out, output]`
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        match self {
            Self::Vn(layer) => layer.forward(x),
            Self::So2(layer) => layer.forward(x),
        }
    }
}
