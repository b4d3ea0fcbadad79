//! Sets of distant lights.

use super::icosahedron;
use super::unit::unit_f32;
use crate::{Error, Result};
use veni_light::sphere::{Equirect, reference};

/// Distant lights: L directions towards them, each with the solid angle ω that it stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct DistantLights {
    directions: Vec<[f32; 3]>,
    solid_angles: Vec<f32>,
}

impl DistantLights {
    /// Lights from any directions (normalised here) and their solid angles in steradians; a sphere's worth adds up
    /// to 4π.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the numbers differ, if there are none, if a direction is zero or not finite, or if a solid
    /// angle is negative or not finite.
    pub fn new(directions: &[[f32; 3]], solid_angles: &[f32]) -> Result<Self> {
        let (n, m) = (directions.len(), solid_angles.len());
        if n != m || n == 0 {
            return Err(Error::invalid(format!(
                "{n} light directions and {m} solid angles: give one for each"
            )));
        }
        let normalised = directions.iter().enumerate().map(|(at, d)| {
            unit_f32(*d)
                .ok_or_else(|| Error::invalid(format!("light {at} has direction {d:?}: it points nowhere")))
        });
        let directions = normalised.collect::<Result<_>>()?;
        if let Some(wrong) = solid_angles.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
            return Err(Error::invalid(format!("{wrong} is not a solid angle of a light: give 0 or more")));
        }
        Ok(Self { directions, solid_angles: solid_angles.to_vec() })
    }

    /// One light per pixel of a panorama, row-major, with the pixel's exact solid angle; native frame.
    pub fn equirect(grid: Equirect) -> Self {
        let solid_angles =
            (0..grid.height).flat_map(|row| std::iter::repeat_n(grid.solid_angle(row) as f32, grid.width));
        Self { directions: grid.directions(), solid_angles: solid_angles.collect() }
    }

    /// The reference implementation's lights: one per pixel of a panorama, row-major, each with weight 1 whatever its
    /// solid angle (MODEL, Rendered images), in their camera frame ([`reference::decoder_directions`]).
    pub fn reference(grid: Equirect) -> Self {
        Self { directions: reference::decoder_directions(grid), solid_angles: vec![1.0; grid.len()] }
    }

    /// The vertices of an icosahedron whose faces are cut into f² triangles, with the smallest f that gives at least
    /// `at_least` of them (10 f² + 2), pushed out to the sphere. A vertex's solid angle is a third of that of the
    /// spherical triangles around it, so they add up to 4π. With `upper`, only those with z > 0 remain.
    ///
    /// The order is that of the reference's `IcosahedronSampler`: the 12 corners, then along each of the 30 edges, then
    /// inside each of the 20 faces.
    pub fn icosahedron(at_least: usize, upper: bool) -> Self {
        let vertices = icosahedron::vertices(at_least);
        let kept = vertices.into_iter().filter(|(d, _)| !upper || d[2] > 0.0);
        let (directions, solid_angles) = kept.unzip();
        Self { directions, solid_angles }
    }

    /// Number of lights, L; at least 1.
    #[expect(clippy::len_without_is_empty, reason = "there is always a light")]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// Unit directions towards the lights.
    pub fn directions(&self) -> &[[f32; 3]] {
        &self.directions
    }

    /// Solid angles, steradians.
    pub fn solid_angles(&self) -> &[f32] {
        &self.solid_angles
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn solid_angles_cover_the_sphere_once() {
        let sets = [
            DistantLights::equirect(Equirect::new(32, 16)),
            DistantLights::icosahedron(1, false),
            DistantLights::icosahedron(500, false),
        ];
        for lights in sets {
            let total: f64 = lights.solid_angles().iter().map(|w| f64::from(*w)).sum();
            assert!((total - 4.0 * PI).abs() < 1e-5, "{} lights cover {total}", lights.len());
            // first moments vanish for a symmetric set
            for axis in 0..3 {
                let pairs = lights.directions().iter().zip(lights.solid_angles());
                let moment: f64 = pairs.map(|(d, w)| f64::from(d[axis] * w)).sum();
                assert!(moment.abs() < 1e-5, "axis {axis}: {moment}");
            }
        }
        assert_eq!(DistantLights::icosahedron(93, false).len(), 162);
        assert!(DistantLights::icosahedron(93, true).directions().iter().all(|d| d[2] > 0.0));
    }

    #[test]
    fn what_is_no_light_is_refused() {
        let message = |d: &[[f32; 3]], w: &[f32]| DistantLights::new(d, w).unwrap_err().to_string();
        assert!(message(&[], &[]).contains("one for each"));
        assert!(message(&[[1.0; 3]], &[1.0, 2.0]).contains("1 light directions and 2"));
        assert!(message(&[[1.0; 3], [0.0; 3]], &[1.0; 2]).contains("light 1"));
        assert!(message(&[[f32::NAN; 3]], &[1.0]).contains("nowhere"));
        assert!(message(&[[1.0; 3]], &[-1.0]).contains("-1"));
        let lights = DistantLights::new(&[[0.0, 3.0, 4.0]], &[1.0]).unwrap();
        assert_eq!(lights.directions(), [[0.0, 0.6, 0.8]]);
    }
}
