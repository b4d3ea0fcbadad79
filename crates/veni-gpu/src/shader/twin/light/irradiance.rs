//! `light_irradiance.wgsl`

use std::f32::consts::PI;

use super::LightTwin;
use super::angle::sin_cos;
use crate::shader::PackedDisc;

/// Points of a disc that the horizon cuts.
const POINTS: usize = 64;

impl LightTwin {
    /// Irradiance of a surface with this unit normal: compact lights as discs, the rest by nine harmonics, not below 0.
    pub fn veni_irradiance(&self, normal: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.veni_light_unrotated(normal);
        let uniform = &self.packed.uniform;
        let terms = [1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y];
        let rest = [0, 1, 2].map(|c| {
            let sum: f32 = uniform.diffuse.iter().zip(terms).map(|(s, term)| s[c] * term).sum();
            sum.max(0.0)
        });
        uniform.lights.iter().fold(rest, |sum, light| {
            let cosine = cosine(light, [x, y, z]);
            [0, 1, 2].map(|c| sum[c] + light.irradiance[c] * cosine)
        })
    }
}

/// Mean of max(0, n·d) over a disc.
fn cosine(light: &PackedDisc, n: [f32; 3]) -> f32 {
    let d = light.direction;
    let cosine = dot(d, n);
    let [sin, cos] = sin_cos(light.radius / (4.0 * PI));
    if cosine.abs() > 2.0 * sin * cos || light.radius < 0.01 {
        return cos * cos * cosine.max(0.0);
    }
    let helper = if d[2].abs() < 0.9 { [-d[1], d[0], 0.0] } else { [0.0, -d[2], d[1]] };
    let length = dot(helper, helper).sqrt();
    let a = helper.map(|v| v / length);
    let b = [d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2], d[0] * a[1] - d[1] * a[0]];
    let (along_a, along_b, cap) = (dot(a, n), dot(b, n), 2.0 * sin * sin);
    let point = |k: usize| {
        let drop = cap * (k as f32 + 0.5) / POINTS as f32;
        let [s, c] = sin_cos(0.381_966_02 * k as f32);
        ((1.0 - drop) * cosine + (drop * (2.0 - drop)).sqrt() * (c * along_a + s * along_b)).max(0.0)
    };
    (0..POINTS).map(point).sum::<f32>() / POINTS as f32
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
