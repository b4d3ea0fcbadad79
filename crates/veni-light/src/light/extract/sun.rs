//! Which of the lights is the sun. LIGHT (8).
//!
//! A panorama has no unit, and a lamp at night may look like a disc in the sky. What tells them apart: the sun outshines the rest
//! of the sky, it lights the sky that it stands in, and there is one of it. The moon does all that too, and is taken for the sun.

use super::level::View;
use super::measure::quantile;
use super::{Found, SunChoice};
use crate::compact::Kind;
use crate::luminance::luminance;

/// Solid angle over which a peak is averaged at least, steradians: a pixel of a panorama of 256 columns.
const PATCH: f64 = 6.0e-4;
/// A disc's peak over the luminance of the brightest fiftieth of the upper hemisphere is at least this.
const DISC: f64 = 20.0;
/// The same for what is spread wider.
const SPREAD: f64 = 12.0;
/// The least share of a wide sun, of a disc high up, and of one near the horizon, which the air dims.
const SHARE: [f64; 3] = [0.1, 0.15, 0.02];
/// What is near the horizon: sine of 10°.
const LOW: f32 = 0.173_648;
/// Sky about the zenith over the irradiance of the sun, per steradian: that of the air alone is about 0.02, of this and less it
/// may be night's.
const DARK_SKY: f64 = 0.06;
/// It is night's if it is also so much darker than the ground, which lamps light and the sky does not.
const DARK: f64 = 0.15;
/// This many lights of nearly the same strength are lamps.
const LAMPS: usize = 3;

/// Luminance of parts of what is left.
struct Surroundings {
    /// 90 % of the sky more than 45° high is darker.
    zenith: f64,
    /// 98 % of the upper hemisphere is darker.
    bright: f64,
    /// Mean of the lower hemisphere.
    ground: f64,
}

impl Surroundings {
    fn new(view: View<'_>) -> Self {
        let (mut high, mut upper) = (Vec::new(), Vec::new());
        let (mut ground, mut area) = (0.0, 0.0);
        for cell in view.all() {
            let y = luminance(cell.radiance);
            if cell.direction[2] > 0.0 {
                upper.push((y, cell.solid_angle));
            } else {
                ground += f64::from(y) * cell.solid_angle;
                area += cell.solid_angle;
            }
            if cell.direction[2] > std::f64::consts::FRAC_1_SQRT_2 {
                high.push((y, cell.solid_angle));
            }
        }
        Self {
            zenith: f64::from(quantile(high, 0.9)),
            bright: f64::from(quantile(upper, 0.98)),
            ground: ground / area.max(f64::MIN_POSITIVE),
        }
    }

    fn is_sun(&self, found: &Found, all: &[Found]) -> bool {
        let light = &found.light;
        let energy = found.whole[0];
        let least = match found.kind {
            Kind::Disc if light.direction[2] > LOW => SHARE[1],
            Kind::Disc => SHARE[2],
            Kind::Glow | Kind::Lobe => SHARE[0],
        };
        let prominent = if found.kind == Kind::Disc { DISC } else { SPREAD };
        let sky = self.zenith / energy;
        let night = sky < DARK_SKY && self.zenith < DARK * self.ground;
        let alike = |other: &&Found| {
            other.light.radius < 3f32.to_radians()
                && other.measured.contrast() > 100.0
                && 4.0 * other.whole[0] > energy
        };
        found.whole[1] >= least
            && found.peak.min(energy / PATCH) >= prominent * self.bright
            && !night
            && all.iter().filter(alike).count() < LAMPS
    }
}

/// The sun among the lights, strongest first.
pub(super) fn choose(found: &[Found], choice: SunChoice, rest: View<'_>) -> Option<usize> {
    // a sun whose upper half is above the horizon counts
    let above = |f: &Found| f.light.direction[2] >= -(0.5 * f.light.radius).sin();
    match choice {
        SunChoice::Nothing | SunChoice::Towards(_) => None,
        SunChoice::Any => (!found.is_empty()).then_some(0),
        SunChoice::Sky => found.iter().position(above),
        SunChoice::Auto => {
            let surroundings = Surroundings::new(rest);
            found.iter().position(|f| above(f) && surroundings.is_sun(f, found))
        }
    }
}
