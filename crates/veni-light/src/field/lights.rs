//! A field's compact lights: constant discs where a direction is asked for, exact parts of them on pixels.

use super::Field;
use crate::compact::{CompactLight, Lights};

/// A light as a test of directions. MODEL (38).
#[derive(Clone, Copy, Debug)]
pub(super) struct Cap {
    direction: [f32; 3],
    /// |d − u|² up to which a direction d is in the disc: 4 sin²(r/2).
    square: f32,
    radiance: [f32; 3],
}

impl Cap {
    /// None for a light without extent, which no direction meets.
    pub(super) fn new(light: &CompactLight) -> Option<Self> {
        let half = (0.5 * f64::from(light.radius)).sin();
        let radiance = light.radiance();
        radiance.iter().all(|v| v.is_finite()).then_some(Self {
            direction: light.direction,
            square: (4.0 * half * half) as f32,
            radiance,
        })
    }

    /// Adds it to the radiance of a direction inside it.
    #[inline(always)]
    pub(super) fn add(&self, direction: [f32; 3], radiance: &mut [f32; 3]) {
        let square: f32 = direction.iter().zip(self.direction).map(|(d, u)| (d - u) * (d - u)).sum();
        if square <= self.square {
            for (sum, own) in radiance.iter_mut().zip(self.radiance) {
                *sum += own;
            }
        }
    }
}

impl Field {
    /// The compact lights, exposure included: what [`Field::radiance`] adds to the network's.
    pub fn lights(&self) -> &Lights {
        &self.folded.lights
    }

    /// The same field without its lights: what is smooth.
    #[must_use]
    pub fn without_lights(&self) -> Self {
        self.with_lights(Lights::default())
    }
}
