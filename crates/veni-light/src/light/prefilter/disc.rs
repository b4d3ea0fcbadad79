//! A compact light in the first level: its disc, with its energy.

use std::f64::consts::PI;

use super::{CubeAxes, CubeMap};
use crate::light::CompactLight;
use crate::sphere::CubeFace;
use crate::vector::across;

/// Rings, and places on each, of a disc.
const RINGS: usize = 64;
const AROUND: usize = 128;

impl CubeMap {
    /// Adds a light as a disc of even radiance: places on it hand their energy to the texels that they fall into, so that the
    /// cube gains E⊥ exactly.
    pub(super) fn add_disc(&mut self, light: &CompactLight, axes: CubeAxes) {
        let size = self.size();
        let n = light.direction.map(f64::from);
        let [u, v] = across(n);
        let cap = 2.0 * (0.5 * f64::from(light.radius)).sin().powi(2);
        let share = 1.0 / (RINGS * AROUND) as f64;
        let mut shares: std::collections::BTreeMap<usize, f64> = std::collections::BTreeMap::new();
        for k in 0..RINGS * AROUND {
            let drop = cap * ((k / AROUND) as f64 + 0.5) / RINGS as f64;
            let tilt = (drop * (2.0 - drop)).sqrt();
            let (s, c) = (2.0 * PI * ((k % AROUND) as f64 + 0.5) / AROUND as f64).sin_cos();
            let direction = [0, 1, 2].map(|i| (n[i] * (1.0 - drop) + tilt * (c * u[i] + s * v[i])) as f32);
            *shares.entry(Self::index(size, axes, direction)).or_default() += share;
        }
        for (index, share) in shares {
            let k = index % (size * size);
            let area = CubeFace::solid_angle(size, k % size, k / size);
            let texel = &mut self.texels_mut()[index];
            *texel = [0, 1, 2].map(|c| texel[c] + (f64::from(light.irradiance[c]) * share / area) as f32);
        }
    }
}
