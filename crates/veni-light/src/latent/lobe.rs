//! A spherical Gaussian of log radiance: detail where the vectors of a code do not reach. MODEL (71).

use crate::limits::MAX_LOBES;
use crate::vector::{dot, narrow, unit};
use crate::{Error, Result};

/// Adds a e^{s(⟨d,u⟩ − 1)} to log radiance: amplitude a in the direction u, 1/e of it where 1 − cos of the angle is 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// Unit direction u of the middle, native frame.
    pub direction: [f32; 3],
    /// Amplitude a (R, G, B), of either sign, in natural log radiance.
    pub amplitude: [f32; 3],
    /// Sharpness s > 0; the lobe's standard deviation is about 1/√s radians.
    pub sharpness: f32,
}

impl Lobe {
    /// What may change of a lobe, in this order: the amplitude (R, G, B), ln s, and the angle of the middle along the two
    /// [tangents](Lobe::tangents). It is stored as seven numbers, since a unit vector has three.
    pub const COORDINATES: usize = 6;

    /// What it adds to log radiance in a unit direction.
    pub fn value(&self, direction: [f32; 3]) -> [f32; 3] {
        let cosine = dot(self.direction, direction);
        let gauss = (self.sharpness * (cosine - 1.0)).exp();
        self.amplitude.map(|a| a * gauss)
    }

    /// The same lobe after a rotation by `angle` radians about z, counter-clockwise seen from above.
    #[must_use]
    pub fn rotated(mut self, angle: f64) -> Self {
        let ((s, c), [x, y, z]) = (angle.sin_cos(), self.direction.map(f64::from));
        self.direction = [c * x - s * y, s * x + c * y, z].map(|v| v as f32);
        self
    }

    /// Two unit vectors that are orthogonal to the direction and to each other, in the plane of which its middle moves: along the
    /// horizon and upwards, so that they rotate with the lobe. At the poles, where neither is defined, along x and y.
    pub fn tangents(&self) -> [[f32; 3]; 2] {
        let [x, y, z] = self.direction.map(f64::from);
        let radius = x.hypot(y);
        let [c, s] = if radius > 1e-6 { [x / radius, y / radius] } else { [0.0, -1.0] };
        [[-s, c, 0.0], [-z * c, -z * s, radius]].map(|v| narrow(unit(v)))
    }

    /// The lobe after a small change of its [coordinates](Lobe::COORDINATES); the middle stays on the sphere.
    #[must_use]
    pub fn moved(mut self, by: &[f64; Self::COORDINATES]) -> Self {
        let [p, q] = self.tangents();
        for (amplitude, by) in self.amplitude.iter_mut().zip(by) {
            *amplitude = (f64::from(*amplitude) + by) as f32;
        }
        self.sharpness = (f64::from(self.sharpness) * by[3].exp()) as f32;
        let along =
            |k: usize| f64::from(self.direction[k]) + by[4] * f64::from(p[k]) + by[5] * f64::from(q[k]);
        self.direction = narrow(unit([0, 1, 2].map(along)));
        self
    }

    /// The lobe of the mirrored scene: azimuth φ becomes −φ.
    #[must_use]
    pub fn mirrored(mut self) -> Self {
        self.direction[1] = -self.direction[1];
        self
    }

    /// The same lobe, `factor` times as high.
    #[must_use]
    pub(super) fn scaled(mut self, factor: f32) -> Self {
        self.amplitude = self.amplitude.map(|a| a * factor);
        self
    }

    /// Refuses what is not a lobe.
    pub(super) fn check(lobes: &[Self]) -> Result<()> {
        if lobes.len() > MAX_LOBES {
            let count = lobes.len();
            return Err(Error::beyond(
                format!("{count} lobes, at most {MAX_LOBES} are taken"),
                count as u64,
                MAX_LOBES as u64,
            ));
        }
        for (at, lobe) in lobes.iter().enumerate() {
            let square = dot(lobe.direction, lobe.direction);
            let is_unit = (square - 1.0).abs() < 1e-3;
            let wrong = if !is_unit {
                format!("direction {:?} is not of length 1", lobe.direction)
            } else if !lobe.amplitude.iter().all(|a| a.is_finite()) {
                format!("amplitude {:?} is not finite", lobe.amplitude)
            } else if !(lobe.sharpness > 0.0 && lobe.sharpness.is_finite()) {
                format!("sharpness {} is not positive", lobe.sharpness)
            } else {
                continue;
            };
            return Err(Error::invalid(format!("lobe {at}: its {wrong}")));
        }
        Ok(())
    }
}
