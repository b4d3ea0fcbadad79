//! `compact.wgsl`. MODEL (71, 72).

use super::Twin;
use crate::shader::{MAX_LIGHTS, MAX_LOBES};

impl Twin {
    /// Radiance of the lights of latent `index` from the native unit direction d.
    pub fn veni_lights_of(&self, index: usize, d: [f32; 3]) -> [f64; 3] {
        self.lights_where(index, d, |_| true)
    }

    /// The same of the lights whose extent is to be counted.
    pub(super) fn lights_where(&self, index: usize, d: [f32; 3], counts: impl Fn(f32) -> bool) -> [f64; 3] {
        let (_, rest) = self.after_vectors(index);
        let mut sum = [0.0; 3];
        for [light, radiance] in pairs(&rest[..8 * MAX_LIGHTS]) {
            if !counts(light[3]) {
                continue;
            }
            let (square, extent) = (square(light, d), f64::from(light[3]));
            let part = match extent < 0.0 {
                true => veni_gauss(extent * square),
                false => f64::from(u8::from(square <= extent)),
            };
            sum = [0, 1, 2].map(|c| sum[c] + part * f64::from(radiance[c]));
        }
        sum
    }

    /// What the lobes of latent `index` add to log radiance.
    pub fn veni_lobes(&self, index: usize, d: [f32; 3]) -> [f64; 3] {
        let (_, rest) = self.after_vectors(index);
        let mut sum = [0.0; 3];
        for [lobe, amplitude] in pairs(&rest[8 * MAX_LIGHTS..][..8 * MAX_LOBES]) {
            let gauss = veni_gauss(f64::from(lobe[3]) * square(lobe, d));
            sum = [0, 1, 2].map(|c| sum[c] + gauss * f64::from(amplitude[c]));
        }
        sum
    }

    /// Log exposure of latent `index`, and its lights and lobes.
    pub(super) fn after_vectors(&self, index: usize) -> (f64, &[f32]) {
        let at = self.row() * (self.sizes.layers + 1) + 4 * self.sizes.latents;
        let rest = &self.latent(index)[at..];
        (f64::from(rest[0]), &rest[4..])
    }
}

/// As many pairs as the fourth component of the first one's second says.
fn pairs(rows: &[f32]) -> impl Iterator<Item = [&[f32]; 2]> {
    let count = rows[7] as usize;
    rows.chunks_exact(8).take(count).map(|pair| [&pair[..4], &pair[4..]])
}

fn square(row: &[f32], d: [f32; 3]) -> f64 {
    row.iter().zip(d).map(|(u, d)| (f64::from(d) - f64::from(*u)).powi(2)).sum()
}

/// e^x, of what is far below 0 as the shader has it.
fn veni_gauss(exponent: f64) -> f64 {
    exponent.max(-87.0).exp()
}
