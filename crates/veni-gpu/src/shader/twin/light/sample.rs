//! `light_sample.wgsl`

use std::f32::consts::{PI, TAU};

use super::LightTwin;
use super::angle::{atan2, sin_cos};

/// The largest f32 below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// A direction that was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VeniLightSample {
    /// Unit, native.
    pub direction: [f32; 3],
    /// Density over solid angle, 1/sr.
    pub pdf: f32,
    /// Linear Rec. 709 radiance from there.
    pub radiance: [f32; 3],
}

impl LightTwin {
    /// A direction from two numbers of [0, 1).
    pub fn veni_sample_light(&self, [u, v]: [f32; 2]) -> VeniLightSample {
        let share = self.packed.uniform.share;
        let (own, texel, inside) = if u < share {
            let own = self.on_sun([u / share, v]);
            (own, self.packed.texels[self.veni_light_pixel(own)], true)
        } else {
            let (pixel, at) = self.veni_light_place([((u - share) / (1.0 - share)).min(BELOW_ONE), v]);
            let own = self.direction(pixel, at);
            (own, self.packed.texels[pixel], self.in_sun(own))
        };
        let [r, g, b, pdf] = self.both(texel, inside);
        VeniLightSample { direction: self.veni_light_rotated(own), pdf, radiance: [r, g, b] }
    }

    /// The density with which a unit direction is drawn, 1/sr.
    pub fn veni_light_pdf(&self, direction: [f32; 3]) -> f32 {
        self.seen(direction)[3]
    }

    /// The radiance from a unit direction that the samples have.
    pub fn veni_light_radiance(&self, direction: [f32; 3]) -> [f32; 3] {
        let [r, g, b, _] = self.seen(direction);
        [r, g, b]
    }

    fn seen(&self, direction: [f32; 3]) -> [f32; 4] {
        let own = self.veni_light_unrotated(direction);
        self.both(self.packed.texels[self.veni_light_pixel(own)], self.in_sun(own))
    }

    fn both(&self, [r, g, b, density]: [f32; 4], inside: bool) -> [f32; 4] {
        let share = self.packed.uniform.share;
        let rest = [r, g, b, (1.0 - share) * density];
        let Some(sun) = self.packed.uniform.lights.first().filter(|_| inside) else { return rest };
        let [sr, sg, sb] = sun.irradiance;
        let mut more = [sr, sg, sb, share].into_iter().map(|v| sun.per_solid_angle * v);
        rest.map(|v| v + more.next().unwrap_or(0.0))
    }

    /// The pixel that two numbers of [0, 1) choose, and the place in it, each coordinate in (0, 1).
    pub fn veni_light_place(&self, [u, v]: [f32; 2]) -> (usize, [f32; 2]) {
        let cells = &self.packed.cells;
        let index = ((u * cells.len() as f32) as usize).min(cells.len() - 1);
        let [bits, other] = cells[index];
        let keep = f32::from_bits(bits);
        let (pixel, rest) =
            if v < keep { (index, v / keep) } else { (other as usize, (v - keep) / (1.0 - keep)) };
        let coarse = rest.min(BELOW_ONE) * 4096.0;
        let fine = ((coarse - coarse.floor()) * 4096.0).floor().min(4095.0);
        (pixel, [(coarse.floor() + 0.5) / 4096.0, (fine + 0.5) / 4096.0])
    }

    /// The direction of a place before the rotation.
    fn direction(&self, pixel: usize, [x, y]: [f32; 2]) -> [f32; 3] {
        let [width, height] = self.packed.uniform.size.map(|n| n as usize);
        let (row, column) = (pixel / width, pixel % width);
        let (r, z) = if row == 0 || row + 1 == height {
            let half = y * self.packed.uniform.pole;
            let cosine = 1.0 - 2.0 * half;
            (2.0 * (half * (1.0 - half)).sqrt(), if row == 0 { cosine } else { -cosine })
        } else {
            let edge = |row: usize| self.packed.texels[width * height + row / 4][row % 4];
            let z = edge(row) + (edge(row + 1) - edge(row)) * y;
            ((1.0 - z * z).max(0.0).sqrt(), z)
        };
        let [s, c] = sin_cos(0.5 - (column as f32 + x) / width as f32);
        [r * c, r * s, z]
    }

    /// The pixel that a unit direction falls into, as it is before the rotation.
    pub fn veni_light_pixel(&self, [x, y, z]: [f32; 3]) -> usize {
        let [width, height] = self.packed.uniform.size.map(|n| n as usize);
        let polar = atan2((x * x + y * y).sqrt(), z);
        let column = (PI - atan2(y, x)) * (width as f32 / TAU);
        let row = polar * (height as f32 / PI);
        (row as usize).min(height - 1) * width + (column as usize).min(width - 1)
    }
}
