//! Irradiance from all directions by the normal of a surface: nine coefficients of spherical harmonics
//! (Ramamoorthi & Hanrahan, SIGGRAPH 2001).

use std::f32::consts::PI;

use glam::Vec3;

/// Irradiance as a function of the normal.
#[derive(Clone, Debug)]
pub(super) struct Ambient {
    coefficients: [Vec3; 9],
    floor: Vec3,
}

impl Ambient {
    /// From radiance samples that cover the sphere evenly.
    pub(super) fn new(samples: &[(Vec3, Vec3)]) -> Self {
        let weight = 4.0 * PI / samples.len().max(1) as f32;
        let mut coefficients = [Vec3::ZERO; 9];
        let mut mean = Vec3::ZERO;
        for (direction, radiance) in samples {
            for (c, y) in coefficients.iter_mut().zip(harmonics(*direction)) {
                *c += *radiance * y * weight;
            }
            mean += *radiance / samples.len().max(1) as f32;
        }
        for (k, c) in coefficients.iter_mut().enumerate() {
            // the cosine lobe
            *c *= if k == 0 {
                PI
            } else if k < 4 {
                2.0 * PI / 3.0
            } else {
                PI / 4.0
            };
        }
        Self { coefficients, floor: 0.1 * PI * mean }
    }

    /// Irradiance on a surface with this unit normal.
    pub(super) fn at(&self, normal: Vec3) -> Vec3 {
        let sum: Vec3 = self.coefficients.iter().zip(harmonics(normal)).map(|(c, y)| *c * y).sum();
        sum.max(self.floor)
    }
}

fn harmonics(d: Vec3) -> [f32; 9] {
    [
        0.282_095,
        0.488_603 * d.y,
        0.488_603 * d.z,
        0.488_603 * d.x,
        1.092_548 * d.x * d.y,
        1.092_548 * d.y * d.z,
        0.315_392 * (3.0 * d.z * d.z - 1.0),
        1.092_548 * d.x * d.z,
        0.546_274 * (d.x * d.x - d.y * d.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bright_half_lights_what_faces_it() {
        let n = 4000;
        let samples: Vec<_> = (0..n)
            .map(|k| {
                let z = 1.0 - 2.0 * (k as f32 + 0.5) / n as f32;
                let (s, c) = (2.399_963 * k as f32).sin_cos();
                let d = Vec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z);
                (d, Vec3::splat(if z > 0.0 { 2.0 } else { 0.0 }))
            })
            .collect();
        let ambient = Ambient::new(&samples);
        // exactly 2π, π and (up to the floor) 0
        assert!((ambient.at(Vec3::Z).x - 2.0 * PI).abs() < 0.02);
        assert!((ambient.at(Vec3::X).x - PI).abs() < 0.02);
        assert!(ambient.at(-Vec3::Z).x < 0.11 * PI);
    }
}
