//! The shader functions of a light on the CPU, in single precision and in the same order, since a pixel is chosen by comparing
//! numbers that are rounded.

mod angle;
mod irradiance;
mod sample;
mod sun;

pub use sample::VeniLightSample;

use crate::shader::PackedLight;

/// A packed light, under the names of `light_*.wgsl`.
#[derive(Clone, Debug)]
pub struct LightTwin {
    packed: PackedLight,
}

impl LightTwin {
    /// A twin of a packed light.
    pub fn new(packed: PackedLight) -> Self {
        Self { packed }
    }

    /// The same with another rotation, radians about z, counter-clockwise seen from above.
    #[must_use]
    pub fn rotated(&self, radians: f64) -> Self {
        let mut packed = self.packed.clone();
        let (sin, cos) = radians.sin_cos();
        packed.uniform.rotation = [sin as f32, cos as f32];
        Self { packed }
    }
}
