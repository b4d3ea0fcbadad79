//! What a lobe makes of a compact light, as a function of the angle to it: computed once per level, looked up per texel.

use super::lobe::{DiscRule, Lobe};
use crate::light::CompactLight;

/// Entries of the table.
const ENTRIES: usize = 1024;

/// A light through a lobe. Entries are even in v = asinh(c / 2α), c the chord between the normal and the light: dense within the
/// lobe, sparse beyond.
#[derive(Clone, Debug)]
pub(super) struct Glint {
    direction: [f32; 3],
    irradiance: [f32; 3],
    inverse_width: f32,
    per_step: f32,
    table: Vec<f32>,
}

impl Glint {
    pub(super) fn new(light: &CompactLight, alpha: f64) -> Self {
        let lobe = Lobe::new(alpha);
        let radius = f64::from(light.radius);
        let rule = DiscRule::new(alpha, radius);
        // a disc smooths the lobe to its own width
        let width = (2.0 * alpha).hypot(radius);
        let step = (2.0 / width).asinh() / ENTRIES as f64;
        let entry = |k: usize| {
            let chord = (width * (step * k as f64).sinh()).min(2.0);
            lobe.over_disc(2.0 * (0.5 * chord).asin(), radius, &rule) as f32
        };
        Self {
            direction: light.direction,
            irradiance: light.irradiance,
            inverse_width: (1.0 / width) as f32,
            per_step: (1.0 / step) as f32,
            table: (0..ENTRIES + 2).map(entry).collect(),
        }
    }

    /// The prefiltered radiance that the light adds around a normal.
    #[inline]
    pub(super) fn at(&self, normal: [f32; 3]) -> [f32; 3] {
        let square: f32 = normal.iter().zip(self.direction).map(|(a, b)| (a - b) * (a - b)).sum();
        let x = (square.sqrt() * self.inverse_width).asinh() * self.per_step;
        let low = (x as usize).min(ENTRIES);
        let t = x - low as f32;
        let value = self.table[low] * (1.0 - t) + self.table[low + 1] * t;
        self.irradiance.map(|e| e * value)
    }
}
