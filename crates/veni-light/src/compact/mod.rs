//! Compact lights: what reaches a scene from a few small solid angles, seven numbers each. LIGHT (1) to (9), MODEL (72).

mod cube;
mod disc;
mod glow;
mod lights;
mod profile;

pub use disc::Disc;
pub(crate) use glow::Glow;
pub use lights::Lights;
pub use profile::{Falloff, Profile};

use crate::vector::{cross, dot, unit};
use std::fmt;

/// A light of small solid angle: the sun, the moon, a lamp, a bright window.
///
/// What is stored is the light's energy, the integral of its radiance over its solid angle, E⊥ = ∫ L dω: it stays finite as
/// the light becomes a point, and is then the irradiance of a surface that faces it. (A disc of radius r lights that surface by
/// cos²(r/2) E⊥; for the sun that is less by 5e-6.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompactLight {
    /// Unit direction towards the light, native frame.
    pub direction: [f32; 3],
    /// Irradiance at normal incidence, E⊥ = ∫ L dω (R, G, B), in units of radiance times steradian.
    pub irradiance: [f32; 3],
    /// Angular radius, radians.
    pub radius: f32,
    /// Where the radius comes from.
    pub radius_source: RadiusSource,
    /// Whether the panorama's largest value cut it off: the irradiance is then a lower bound.
    pub clipped: bool,
}

/// Where the angular radius of a [`CompactLight`] comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RadiusSource {
    /// From the panorama.
    Measured,
    /// The sun's true radius: the panorama's pixels are too large to show another.
    Assumed,
    /// Asked for.
    Requested,
}

/// How wide a [`CompactLight`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A disc of less than 1.5° radius.
    Disc,
    /// Spread over 1.5° to 6°: a sun through haze or thin cloud.
    Glow,
    /// Wider than 6°, as in decoded latents and in panoramas of low dynamic range.
    Lobe,
}

impl Kind {
    /// Largest angular radius of a disc, degrees.
    const DISC: f32 = 1.5;
    /// Largest angular radius of a glow, degrees.
    const GLOW: f32 = 6.0;

    /// The kind of a light of this angular radius, radians.
    pub fn of(radius: f32) -> Self {
        match radius.to_degrees() {
            r if r < Self::DISC => Self::Disc,
            r if r <= Self::GLOW => Self::Glow,
            _ => Self::Lobe,
        }
    }
}

impl fmt::Display for RadiusSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Measured => "measured",
            Self::Assumed => "assumed",
            Self::Requested => "requested",
        })
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Disc => "disc",
            Self::Glow => "glow",
            Self::Lobe => "lobe",
        })
    }
}

/// A light as radiance in any direction: a disc, or of what is wider than one a smooth lobe. MODEL (72).
#[derive(Clone, Copy, Debug)]
pub(crate) enum Emitter {
    /// Constant radiance where |d − u|² is at most a square: 4 sin²(r/2).
    Disc {
        direction: [f32; 3],
        square: f32,
        radiance: [f32; 3],
    },
    Glow(Glow),
}

impl Emitter {
    /// None for a light without extent, which no direction meets.
    pub(crate) fn new(light: &CompactLight) -> Option<Self> {
        if let Some(glow) = Glow::new(light) {
            return Some(Self::Glow(glow));
        }
        let half = (0.5 * f64::from(light.radius)).sin();
        let (direction, radiance) = (light.direction, light.radiance());
        let square = (4.0 * half * half) as f32;
        radiance.iter().all(|v| v.is_finite()).then_some(Self::Disc { direction, square, radiance })
    }

    /// Adds the light to the radiance of a unit direction.
    #[inline(always)]
    pub(crate) fn add(&self, d: [f32; 3], sum: &mut [f32; 3]) {
        match self {
            Self::Disc { direction, square, radiance } => {
                let apart: f32 = d.iter().zip(direction).map(|(d, u)| (d - u) * (d - u)).sum();
                if apart <= *square {
                    for (sum, own) in sum.iter_mut().zip(radiance) {
                        *sum += own;
                    }
                }
            }
            Self::Glow(glow) => glow.add(d, sum),
        }
    }
}

impl CompactLight {
    /// Angular radius of the sun as seen from the earth, radians: 0.2665°.
    pub const SUN_RADIUS: f32 = 0.2665 * std::f32::consts::PI / 180.0;

    /// Discs of a smaller radius are points, radians.
    const SMALL: f32 = 1e-2;
    /// Points of a disc that is cut.
    const POINTS: usize = 64;

    /// A light of this unit direction, irradiance at normal incidence and angular radius in radians.
    pub fn new(direction: [f32; 3], irradiance: [f32; 3], radius: f32) -> Self {
        Self { direction, irradiance, radius, radius_source: RadiusSource::Requested, clipped: false }
    }

    /// How wide it is.
    pub fn kind(&self) -> Kind {
        Kind::of(self.radius)
    }

    /// Azimuth in radians, counter-clockwise from +x seen from above, in (−π, π].
    pub fn azimuth(&self) -> f32 {
        self.direction[1].atan2(self.direction[0])
    }

    /// Elevation above the horizon in radians.
    pub fn elevation(&self) -> f32 {
        let [x, y, z] = self.direction;
        z.atan2(x.hypot(y))
    }

    /// Solid angle of the disc, Ω = 2π(1 − cos r).
    pub fn solid_angle(&self) -> f32 {
        // 1 − cos r without cancellation
        let s = (0.5 * self.radius).sin();
        4.0 * std::f32::consts::PI * s * s
    }

    /// Radiance of the disc above what surrounds it, E⊥ / Ω. Infinite for a radius of 0.
    pub fn radiance(&self) -> [f32; 3] {
        self.irradiance.map(|e| e / self.solid_angle())
    }

    /// Irradiance of a surface with this unit normal, the part of the disc below its horizon left out: E⊥ times the mean of
    /// max(0, n·d) over the disc.
    pub fn irradiance_on(&self, normal: [f32; 3]) -> [f32; 3] {
        let cosine = dot(self.direction, normal);
        let mean = if cosine.abs() > self.radius.sin() || self.radius < Self::SMALL {
            // all or nothing of it is above: the mean of the cosine over a disc is cos² (r/2) that of its middle
            let half = (0.5 * self.radius).cos();
            half * half * cosine.max(0.0)
        } else {
            self.cut(normal)
        };
        self.irradiance.map(|e| e * mean)
    }

    /// The same at the horizon, over points spread evenly.
    fn cut(&self, normal: [f32; 3]) -> f32 {
        let [x, y, z] = self.direction;
        let across = if z.abs() < 0.9 { [-y, x, 0.0] } else { [0.0, -z, y] };
        let u = unit(across);
        let v = cross(self.direction, u);
        let [d, a, b] = [self.direction, u, v].map(|w| dot(w, normal));
        let points = (0..Self::POINTS).map(|k| {
            let cos = 1.0 - (1.0 - self.radius.cos()) * (k as f32 + 0.5) / Self::POINTS as f32;
            // the golden angle
            let (sin_k, cos_k) = (2.399_963 * k as f32).sin_cos();
            (cos * d + (1.0 - cos * cos).max(0.0).sqrt() * (cos_k * a + sin_k * b)).max(0.0)
        });
        points.sum::<f32>() / Self::POINTS as f32
    }

    /// The same light after a rotation by `angle` radians about z, counter-clockwise seen from above.
    #[must_use]
    pub fn rotated(mut self, angle: f64) -> Self {
        let ((s, c), [x, y, z]) = (angle.sin_cos(), self.direction.map(f64::from));
        self.direction = [c * x - s * y, s * x + c * y, z].map(|v| v as f32);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(direction: [f32; 3]) -> CompactLight {
        CompactLight::new(direction, [3.0, 2.0, 1.0], CompactLight::SUN_RADIUS)
    }

    #[test]
    fn angles_and_rotations() {
        let light = light([0.6, 0.0, 0.8]);
        assert!(light.azimuth().abs() < 1e-6);
        assert!((light.elevation() - 0.8f32.asin()).abs() < 1e-6);
        let rotated = light.rotated(1.0);
        assert!((rotated.azimuth() - 1.0).abs() < 1e-6);
        assert!((rotated.elevation() - light.elevation()).abs() < 1e-6);
    }

    #[test]
    fn a_wide_light_reaches_behind_the_edge() {
        let light = CompactLight { radius: 0.3, ..light([0.6, 0.0, 0.8]) };
        let facing = light.irradiance_on(light.direction)[0];
        assert!((facing / (3.0 * 0.15f32.cos().powi(2)) - 1.0).abs() < 1e-5, "{facing}");
        // a surface whose horizon halves the disc: (2/3π) sin r of it, to third order
        let half = light.irradiance_on([0.8, 0.0, -0.6])[0];
        let expected = 3.0 * 2.0 * 0.3f32.sin() / (3.0 * std::f32::consts::PI);
        assert!((half / expected - 1.0).abs() < 0.03, "{half} {expected}");
        assert_eq!(light.irradiance_on([-0.6, 0.0, -0.8]), [0.0; 3]);
        let point = CompactLight { radius: 0.0, ..light };
        assert_eq!(point.irradiance_on([0.8, 0.0, -0.6])[0].max(1e-6), 1e-6);
    }

    #[test]
    fn radiance_over_the_disc_is_the_irradiance() {
        let light = light([0.0, 0.0, 1.0]);
        // ∫ dω over the disc by quadrature
        let n = 10_000;
        let dt = f64::from(light.radius) / f64::from(n);
        let solid_angle: f64 =
            (0..n).map(|k| std::f64::consts::TAU * (dt * (f64::from(k) + 0.5)).sin() * dt).sum();
        for (l, e) in light.radiance().into_iter().zip(light.irradiance) {
            assert!((f64::from(l) * solid_angle / f64::from(e) - 1.0).abs() < 1e-5);
        }
    }
}
