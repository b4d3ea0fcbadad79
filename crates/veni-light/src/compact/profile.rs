//! A light's radiance as plain numbers, for evaluators outside of this crate: a shader, for instance. MODEL (72).

use super::{CompactLight, Emitter, Glow};

/// What a light adds in a unit direction d: `peak` times a function of the squared chord |d − u|² to its direction u.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Radiance in the middle (R, G, B).
    pub peak: [f32; 3],
    /// How it falls off from there.
    pub falloff: Falloff,
}

/// How a light's radiance depends on the squared chord |d − u|².
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Falloff {
    /// 1 where it is at most this, 4 sin²(r/2), and 0 elsewhere.
    Disc(f32),
    /// e^{−κ |d − u|² / 2} with this κ, of a light of the kinds [`Glow`](super::Kind::Glow) and [`Lobe`](super::Kind::Lobe).
    Glow(f64),
}

impl Falloff {
    /// The largest κ of a glow whose value at the middle of a pixel of this angle, radians, is its mean over the pixel: such a glow
    /// needs no areas. 0 where none is so smooth.
    pub fn sharpest(pixel: f64) -> f64 {
        Glow::sharpest(pixel)
    }
}

impl CompactLight {
    /// Its radiance as a function of direction; none for a light without extent, which no direction meets.
    pub fn profile(&self) -> Option<Profile> {
        match Emitter::new(self)? {
            Emitter::Disc { square, radiance, .. } => {
                Some(Profile { peak: radiance, falloff: Falloff::Disc(square) })
            }
            Emitter::Glow(glow) => {
                Some(Profile { peak: glow.middle(), falloff: Falloff::Glow(glow.concentration()) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_the_light() {
        for radius in [0.004_65, 0.02, 0.03, 0.3, 1.2] {
            let light = CompactLight::new([0.6, 0.0, 0.8], [3.0, 2.0, 1.0], radius);
            let (profile, emitter) = (light.profile().unwrap(), Emitter::new(&light).unwrap());
            for angle in [0.0, 0.9 * radius, 1.1 * radius, 3.0 * radius] {
                let (s, c) = (light.direction[2].asin() + angle).sin_cos();
                let d = [c, 0.0, s];
                let mut expected = [0.0; 3];
                emitter.add(d, &mut expected);
                let square: f32 =
                    d.iter().zip([0.6, 0.0, 0.8]).map(|(a, b): (&f32, f32)| (a - b) * (a - b)).sum();
                let part = match profile.falloff {
                    Falloff::Disc(most) => f32::from(u8::from(square <= most)),
                    Falloff::Glow(kappa) => (-0.5 * kappa as f32 * square).exp(),
                };
                for (a, b) in profile.peak.into_iter().zip(expected) {
                    assert!((a * part - b).abs() <= 1e-5 * a, "{radius}, {angle}: {} for {b}", a * part);
                }
            }
        }
        assert!(CompactLight::new([0.0, 0.0, 1.0], [1.0; 3], 0.0).profile().is_none());
    }

    #[test]
    fn what_is_smooth_is_taken_at_one_place() {
        for (pixel, kappa) in [(0.02, 30.0), (0.02, 40.0), (0.001, 15_000.0), (0.001, 16_000.0), (0.05, 0.1)]
        {
            let glow = Glow::of_concentration(kappa);
            assert_eq!(kappa <= Falloff::sharpest(pixel), glow.places(pixel) == 1, "{pixel}, {kappa}");
        }
    }
}
