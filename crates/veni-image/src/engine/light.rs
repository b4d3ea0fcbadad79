//! The sun in the words of engines.

use veni_light::light::CompactLight;
use veni_light::sphere::Frame;
use veni_light::vector::{cross, unit};

use crate::luminance;

/// A sun in an engine's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct FramedSun {
    /// Towards the sun.
    pub(super) direction: [f32; 3],
    /// Irradiance at normal incidence.
    pub(super) irradiance: [f32; 3],
    /// Angular diameter, degrees.
    pub(super) diameter: f32,
}

impl FramedSun {
    pub(super) fn new(sun: &CompactLight, frame: Frame) -> Self {
        // + 0 makes −0 positive
        let direction = frame.from_native(sun.direction).map(|v| v + 0.0);
        Self { direction, irradiance: sun.irradiance, diameter: 2.0 * sun.radius.to_degrees() }
    }

    /// The way the light travels.
    pub(super) fn away(&self) -> [f32; 3] {
        self.direction.map(|v| 0.0 - v)
    }

    /// The brightest channel of the irradiance, and the colour of which it is 1.
    pub(super) fn by_brightest(&self) -> (f32, [f32; 3]) {
        let largest = self.irradiance.into_iter().fold(0f32, f32::max);
        (largest, self.irradiance.map(|e| e / largest))
    }

    /// Luminance of the irradiance, and the colour whose luminance is 1.
    pub(super) fn by_luminance(&self) -> (f32, [f32; 3]) {
        let y = luminance(self.irradiance);
        (y, self.irradiance.map(|e| e / y))
    }

    /// A right-handed orthonormal basis whose z points to the sun: x, y, z.
    pub(super) fn basis(&self) -> [[f32; 3]; 3] {
        let z = self.direction;
        let helper = if z[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
        let x = unit(cross(helper, z));
        [x, cross(z, x), z]
    }
}

/// Three numbers with commas.
pub(super) fn triple(v: [f32; 3]) -> String {
    format!("{}, {}, {}", v[0], v[1], v[2])
}

/// Three numbers with spaces.
pub(super) fn spaced(v: [f32; 3]) -> String {
    format!("{} {} {}", v[0], v[1], v[2])
}
