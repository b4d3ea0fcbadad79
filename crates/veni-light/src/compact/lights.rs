//! The compact lights of a scene.

use std::ops::{Deref, Range};

use super::{CompactLight, Disc, Glow, RadiusSource};
use crate::limits::MAX_LIGHTS;
use crate::sphere::{Equirect, Frame};
use crate::vector::{dot, normalised};
use crate::{Error, Result};

/// Lights further apart than this, radians, are not the same light of two scenes: 45°.
const SAME: f32 = std::f32::consts::FRAC_PI_4;

/// A scene's compact lights: the sun first where there is one, then the others. A slice of them, with a word on the first.
///
/// ```
/// use veni_light::light::{CompactLight, Lights};
///
/// let sun = CompactLight::new([0.6, 0.0, 0.8], [9.0, 8.0, 7.0], CompactLight::SUN_RADIUS);
/// let lights = Lights::new(Some(sun), Vec::new());
/// assert_eq!(lights.len(), 1);
/// assert_eq!(lights.rotated(1.0).sun().unwrap().elevation(), sun.elevation());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    all: Vec<CompactLight>,
    has_sun: bool,
}

impl Lights {
    /// The most lights that are taken out of one panorama.
    pub const MOST: usize = 8;

    /// The most lights that are measured in a panorama unless somebody says otherwise: a sun, and what else is bright and small. Few
    /// outdoor panoramas need more.
    pub const USUAL: usize = 4;

    /// A sun, and other lights.
    pub fn new(sun: Option<CompactLight>, others: impl IntoIterator<Item = CompactLight>) -> Self {
        Self { has_sun: sun.is_some(), all: sun.into_iter().chain(others).collect() }
    }

    /// The sun, where there is one.
    pub fn sun(&self) -> Option<&CompactLight> {
        self.all.first().filter(|_| self.has_sun)
    }

    /// The lights that are not the sun.
    pub fn others(&self) -> &[CompactLight] {
        &self.all[usize::from(self.has_sun)..]
    }

    /// The same lights after a rotation by `angle` radians about z, counter-clockwise seen from above.
    #[must_use]
    pub fn rotated(&self, angle: f64) -> Self {
        self.map(|light| light.rotated(angle))
    }

    /// The lights of the mirrored scene: azimuth φ becomes −φ.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        self.map(|light| {
            let [x, y, z] = light.direction;
            CompactLight { direction: [x, -y, z], ..light }
        })
    }

    /// The same lights, `factor` times as strong.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        self.map(|light| CompactLight { irradiance: light.irradiance.map(|e| e * factor), ..light })
    }

    /// Adds what of the lights lies in the pixels of `rows` of a panorama, which `pixels` are: of discs the exact part, of wider
    /// lights, which are smooth lobes, the mean.
    ///
    /// # Panics
    /// If there are not as many pixels as the rows have.
    pub fn add_to_rows(&self, grid: Equirect, rows: Range<usize>, pixels: &mut [[f32; 3]]) {
        assert_eq!(pixels.len(), rows.len() * grid.width, "pixels of rows {rows:?}");
        for light in &self.all {
            match Glow::new(light) {
                Some(glow) => glow.add_to_rows(grid, rows.clone(), pixels),
                None => light.add_to_rows(grid, rows.clone(), pixels),
            }
        }
    }

    /// What each pixel of `rows` of a panorama gains from the lights, as [`Lights::add_to_rows`] adds it: row-major indices within
    /// the whole grid, ascending for each light, and radiance.
    pub fn on_rows(&self, grid: Equirect, rows: Range<usize>) -> Vec<(usize, [f32; 3])> {
        let mut gains = Vec::new();
        for light in &self.all {
            let reached = match Glow::new(light) {
                Some(glow) => glow.rows(grid, rows.clone()),
                None => Disc::new(light.direction, light.radius).rows(grid, rows.clone()),
            };
            let first = reached.start * grid.width;
            let mut pixels = vec![[0.0; 3]; reached.len() * grid.width];
            Self::new(None, [*light]).add_to_rows(grid, reached, &mut pixels);
            gains.extend((first..).zip(pixels).filter(|(_, gained)| *gained != [0.0; 3]));
        }
        gains
    }

    /// The largest value that one of the lights adds to a pixel of a panorama.
    pub fn peak(&self, grid: Equirect) -> f32 {
        let of_light = |light: &CompactLight| {
            if let Some(glow) = Glow::new(light) {
                return glow.most();
            }
            let most = light.irradiance.into_iter().fold(0.0, f32::max);
            let parts = Disc::new(light.direction, light.radius).parts(grid).into_iter();
            let density = parts.map(|(index, part)| part / grid.solid_angle(index / grid.width));
            (density.fold(0.0, f64::max) * f64::from(most)) as f32
        };
        self.all.iter().map(of_light).fold(0.0, f32::max)
    }

    /// What each texel of a cube map whose faces are named by `frame`
    /// ([`CubeFace::direction`](crate::sphere::CubeFace::direction)) gains from the lights: indices, face after face,
    /// row-major and ascending for each light, and radiance.
    pub fn on_cube(&self, frame: Frame, size: usize) -> Vec<(usize, [f32; 3])> {
        self.all.iter().flat_map(|light| light.on_cube(frame, size)).collect()
    }

    /// Between this at `t` = 0 and `other` at 1. The sun of one moves along the great circle to the sun of the other, another
    /// light to the nearest within 45°; a light that only one of the two has fades.
    #[must_use]
    pub fn between(&self, other: &Self, t: f32) -> Self {
        let sun = match (self.sun(), other.sun()) {
            (Some(a), Some(b)) => Some(moved(a, b, t)),
            (Some(a), None) => Some(faded(a, 1.0 - t)),
            (None, Some(b)) => Some(faded(b, t)),
            (None, None) => None,
        };
        let mut theirs = other.others().to_vec();
        let mut others = Vec::new();
        for light in self.others() {
            let nearest = (0..theirs.len())
                .map(|at| (angle(light.direction, theirs[at].direction), at))
                .filter(|(angle, _)| *angle < SAME)
                .min_by(|a, b| a.0.total_cmp(&b.0));
            others.push(match nearest {
                Some((_, at)) => moved(light, &theirs.swap_remove(at), t),
                None => faded(light, 1.0 - t),
            });
        }
        others.extend(theirs.iter().map(|light| faded(light, t)));
        // what has faded away is gone
        let seen = |light: &CompactLight| light.irradiance.iter().any(|e| *e > 0.0);
        others.retain(seen);
        Self::new(sun.filter(seen), others)
    }

    /// Refuses what is not a light.
    ///
    /// # Errors
    /// [`Error`] of kind `Invalid` naming the first light whose direction is not a unit vector, whose irradiance is negative or not
    /// finite, or whose radius is not between 0 and π; of kind `TooLarge` for more than [`MAX_LIGHTS`].
    pub fn check(&self) -> Result<()> {
        if self.all.len() > MAX_LIGHTS {
            let count = self.all.len();
            return Err(Error::beyond(
                format!("{count} lights, at most {MAX_LIGHTS} are taken"),
                count as u64,
                MAX_LIGHTS as u64,
            ));
        }
        for (at, light) in self.all.iter().enumerate() {
            let square = dot(light.direction, light.direction);
            let unit = (square - 1.0).abs() < 1e-3;
            let wrong = if !unit {
                format!("direction {:?} is not of length 1", light.direction)
            } else if !light.irradiance.iter().all(|e| e.is_finite() && *e >= 0.0) {
                format!("irradiance {:?} is not finite and positive", light.irradiance)
            } else if !(light.radius >= 0.0 && light.radius <= std::f32::consts::PI) {
                format!("radius {} is not between 0 and π", light.radius)
            } else {
                continue;
            };
            return Err(Error::invalid(format!("light {at}: its {wrong}")));
        }
        Ok(())
    }

    fn map(&self, change: impl Fn(CompactLight) -> CompactLight) -> Self {
        Self { all: self.all.iter().copied().map(change).collect(), has_sun: self.has_sun }
    }

    /// The integral of the lights' radiance over the sphere, Σ E⊥, per channel.
    pub fn integral(&self) -> [f64; 3] {
        self.all
            .iter()
            .fold([0.0; 3], |sum, light| [0, 1, 2].map(|c| sum[c] + f64::from(light.irradiance[c])))
    }
}

/// Angle between unit vectors, radians.
fn angle(a: [f32; 3], b: [f32; 3]) -> f32 {
    let chord: f32 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    2.0 * (0.5 * chord.sqrt()).min(1.0).asin()
}

fn faded(light: &CompactLight, factor: f32) -> CompactLight {
    CompactLight { irradiance: light.irradiance.map(|e| e * factor), ..*light }
}

/// One light on its way from `a` to `b`.
fn moved(a: &CompactLight, b: &CompactLight, t: f32) -> CompactLight {
    let mix = |a: f32, b: f32| (1.0 - t) * a + t * b;
    let angle = angle(a.direction, b.direction);
    let weights = if angle > 1e-4 { [((1.0 - t) * angle).sin(), (t * angle).sin()] } else { [1.0 - t, t] };
    let sum = [0, 1, 2].map(|c| weights[0] * a.direction[c] + weights[1] * b.direction[c]);
    // exact ends; opposite directions have no way between them
    let direction = match t {
        0.0 => a.direction,
        1.0 => b.direction,
        _ => normalised(sum).unwrap_or(a.direction),
    };
    let both = a.radius_source == b.radius_source;
    CompactLight {
        direction,
        irradiance: [0, 1, 2].map(|c| mix(a.irradiance[c], b.irradiance[c])),
        radius: mix(a.radius, b.radius),
        radius_source: if both { a.radius_source } else { RadiusSource::Assumed },
        clipped: a.clipped || b.clipped,
    }
}

impl Deref for Lights {
    type Target = [CompactLight];

    fn deref(&self) -> &[CompactLight] {
        &self.all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(azimuth: f32, elevation: f32, irradiance: f32) -> CompactLight {
        let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
        CompactLight::new([ce * ca, ce * sa, se], [irradiance; 3], CompactLight::SUN_RADIUS)
    }

    #[test]
    fn suns_move_and_strangers_fade() {
        let a = Lights::new(Some(light(0.0, 30.0, 4.0)), [light(100.0, 0.0, 1.0)]);
        let b = Lights::new(Some(light(90.0, 30.0, 2.0)), [light(-100.0, 0.0, 3.0), light(110.0, 0.0, 2.0)]);
        assert_eq!(a.between(&b, 0.0), a);
        // the same lights, if in another order
        let end = a.between(&b, 1.0);
        assert_eq!(end.sun(), b.sun());
        assert!(end.len() == 3 && b.iter().all(|light| end.contains(light)));
        let middle = a.between(&b, 0.5);
        let sun = middle.sun().unwrap();
        assert!((sun.azimuth().to_degrees() - 45.0).abs() < 1e-3, "{sun:?}");
        assert!((angle(sun.direction, a[0].direction) - angle(sun.direction, b[0].direction)).abs() < 1e-5);
        assert_eq!(sun.irradiance, [3.0; 3]);
        let others: Vec<f32> = middle.others().iter().map(|l| l.irradiance[0]).collect();
        assert_eq!(others, [1.5, 1.5]);
        // without jumps
        let mut before = a.clone();
        for step in 1..=100 {
            let now = a.between(&b, step as f32 / 100.0);
            let (p, q) = (before.integral()[0], now.integral()[0]);
            assert!((p - q).abs() < 0.05, "{step}: {p} {q}");
            before = now;
        }
        let night = Lights::default();
        assert_eq!(a.between(&night, 0.25).sun().unwrap().irradiance, [3.0; 3]);
        assert!(night.between(&a, 1.0) == a && night.between(&night, 0.5).is_empty());
    }

    #[test]
    fn mirrored_scenes_rotate_the_other_way() {
        let a = Lights::new(Some(light(20.0, 30.0, 4.0)), [light(100.0, 0.0, 1.0)]);
        let near = |a: &Lights, b: &Lights| {
            a.iter().zip(b.iter()).all(|(a, b)| angle(a.direction, b.direction) < 1e-6)
        };
        assert!(near(&a.rotated(0.4).mirrored(), &a.mirrored().rotated(-0.4)));
        assert!(!near(&a.rotated(0.4).mirrored(), &a.mirrored().rotated(0.4)));
        assert_eq!(a.scaled(2.0).integral(), a.integral().map(|e| 2.0 * e));
    }

    #[test]
    fn gains_of_rows_are_what_is_added() {
        let (sun, glow) = (light(179.9, 30.0, 4.0), CompactLight { radius: 0.1, ..light(100.0, 88.0, 1.0) });
        let lights = Lights::new(Some(sun), [glow, CompactLight { radius: 0.0, ..light(3.0, -80.0, 2.0) }]);
        for (width, rows) in [(64, 0..32), (500, 80..100), (64, 28..31), (64, 5..5)] {
            let grid = Equirect::new(width, width / 2);
            let mut expected = vec![[0.0; 3]; rows.len() * width];
            lights.add_to_rows(grid, rows.clone(), &mut expected);
            let mut found = vec![[0.0; 3]; rows.len() * width];
            for (index, gained) in lights.on_rows(grid, rows.clone()) {
                let pixel = &mut found[index - rows.start * width];
                *pixel = [0, 1, 2].map(|c| pixel[c] + gained[c]);
            }
            for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((a - b).abs() <= 1e-6 * b, "{width}, {rows:?}: {a} for {b}");
            }
            assert_eq!(rows.is_empty(), expected.iter().all(|p| *p == [0.0; 3]), "{rows:?}");
        }
    }

    #[test]
    fn what_is_no_light_is_refused() {
        let refused = |change: &dyn Fn(&mut CompactLight)| {
            let mut sun = light(0.0, 10.0, 1.0);
            change(&mut sun);
            Lights::new(Some(sun), []).check().unwrap_err().to_string()
        };
        assert!(refused(&|l| l.direction = [0.0; 3]).contains("length 1"));
        assert!(refused(&|l| l.direction[0] = f32::NAN).contains("length 1"));
        assert!(refused(&|l| l.irradiance[1] = -1.0).contains("irradiance"));
        assert!(refused(&|l| l.irradiance[1] = f32::INFINITY).contains("irradiance"));
        assert!(refused(&|l| l.radius = f32::NAN).contains("radius"));
        let many = Lights::new(None, vec![light(0.0, 0.0, 1.0); MAX_LIGHTS + 1]);
        assert!(many.check().is_err());
    }
}
