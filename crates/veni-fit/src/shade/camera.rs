//! A pinhole camera and its rays.

use serde::{Deserialize, Serialize};

use super::unit::unit;
use crate::{Error, Result};
use veni_light::vector::{add, cross, narrow, scaled, sub};

/// The horizontal field of view of the reference's renderings, radians (MODEL, Rendered images): 39.6°.
pub const REFERENCE_FIELD_OF_VIEW: f64 = 0.691_111_2;

/// A pinhole camera with square pixels. Pixel (column i, row j) of W × H looks along
///
/// > forward + tan(fov/2) ((2i + 1 − W)/W right + (H − 2j − 1)/W up)
///
/// so that the field of view is horizontal and row 0 is on top.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Where it stands.
    pub position: [f64; 3],
    /// Unit vector to the right of the image.
    pub right: [f64; 3],
    /// Unit vector to the top of the image.
    pub up: [f64; 3],
    /// Unit vector it looks along.
    pub forward: [f64; 3],
    /// Horizontal field of view, radians.
    pub field_of_view: f64,
}

impl Camera {
    /// The reference implementation's camera: at the origin, looking along −z, x to the right, y up.
    pub fn reference() -> Self {
        Self {
            position: [0.0; 3],
            right: [1.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            forward: [0.0, 0.0, -1.0],
            field_of_view: REFERENCE_FIELD_OF_VIEW,
        }
    }

    /// A camera of the native frame (z up) that looks from `position` at `target`, upright; straight up or down, the
    /// image's right is −y.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the two are the same point, or the field of view is not between 0 and π.
    pub fn look_at(position: [f64; 3], target: [f64; 3], field_of_view: f64) -> Result<Self> {
        let forward = unit(sub(target, position)).ok_or_else(|| {
            Error::invalid(format!("the camera at {position:?} looks at itself: move it or its target"))
        })?;
        let right = unit(cross(forward, [0.0, 0.0, 1.0])).unwrap_or([0.0, -1.0, 0.0]);
        let camera = Self { position, right, up: cross(right, forward), forward, field_of_view };
        camera.check()?;
        Ok(camera)
    }

    /// A camera of the native frame that sees a whole sphere, from the side that `azimuth` and `elevation` (radians) name:
    /// the camera stands at azimuth + π and looks along the azimuth, down by the elevation. The sphere fills the smaller
    /// side of a `width` × `height` image but for `margin`, a fraction of that side.
    ///
    /// # Errors
    /// As [`Camera::look_at`].
    pub fn framing(
        (centre, radius): ([f64; 3], f64),
        [azimuth, elevation]: [f64; 2],
        field_of_view: f64,
        [width, height]: [usize; 2],
        margin: f64,
    ) -> Result<Self> {
        let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.sin_cos(), elevation.sin_cos());
        let forward = [cos_a * cos_e, sin_a * cos_e, -sin_e];
        // the cone that touches the sphere has half angle asin(r/d)
        let smaller = width.min(height) as f64 / width as f64;
        let half = ((0.5 * field_of_view).tan() * smaller * (1.0 - margin)).atan();
        let position = sub(centre, scaled(forward, radius / half.sin()));
        let camera = Self::look_at(position, centre, field_of_view)?;
        // the direction is known better than as a difference of points
        let right = [sin_a, -cos_a, 0.0];
        Ok(Self { forward, right, up: cross(right, forward), ..camera })
    }

    /// Unit rays of all pixels, row-major, pointing away from the camera.
    pub fn rays(&self, width: usize, height: usize) -> Vec<[f32; 3]> {
        let ray = |k: usize| narrow(self.ray(width, height, k % width, k / width));
        (0..width * height).map(ray).collect()
    }

    /// The ray of one pixel.
    pub(super) fn ray(&self, width: usize, height: usize, column: usize, row: usize) -> [f64; 3] {
        let (w, h) = (width as f64, height as f64);
        let (i, j) = (column as f64, row as f64);
        let tan = (0.5 * self.field_of_view).tan();
        let across = scaled(self.right, tan * (2.0 * i + 1.0 - w) / w);
        let up = scaled(self.up, tan * (h - 2.0 * j - 1.0) / w);
        let ray = unit(add(self.forward, add(across, up)));
        ray.expect("a field of view below π leaves a part along forward")
    }

    /// Reads what [`Camera::to_json`] wrote.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not that, if its axes are not orthonormal, or if its field of view is not between
    /// 0 and π.
    pub fn from_json(text: &str) -> Result<Self> {
        let camera: Self =
            serde_json::from_str(text).map_err(|e| Error::invalid(format!("no camera: {e}")))?;
        camera.check()?;
        Ok(camera)
    }

    /// One line of JSON: what an image of normals carries in its attribute `veni:camera`.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("finite numbers are JSON")
    }

    fn check(&self) -> Result<()> {
        let axes = [self.right, self.up, self.forward];
        let product = |a: usize, b: usize| veni_light::vector::dot(axes[a], axes[b]);
        for a in 0..3 {
            for b in 0..3 {
                let expected = if a == b { 1.0 } else { 0.0 };
                let off = (product(a, b) - expected).abs();
                if off.is_nan() || off > 1e-6 {
                    return Err(Error::invalid(format!("the camera's axes {axes:?} are not orthonormal")));
                }
            }
        }
        if !(self.field_of_view > 0.0 && self.field_of_view < std::f64::consts::PI) {
            return Err(Error::invalid(format!(
                "a field of view of {} radians: give one between 0 and π",
                self.field_of_view
            )));
        }
        if !self.position.iter().all(|v| v.is_finite()) {
            return Err(Error::invalid(format!("the camera's position {:?} is not finite", self.position)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::vector::wide;

    #[test]
    fn the_corner_pixels_look_where_they_should() {
        let camera = Camera::look_at([-5.0, 0.0, 0.0], [0.0; 3], 1.0).unwrap();
        let rays = camera.rays(4, 2);
        // along +x, right is −y, up is +z
        let tan = 0.5f64.tan();
        let [x, y, z] = wide(rays[0]);
        assert!((y / x - 0.75 * tan).abs() < 1e-6 && (z / x - 0.25 * tan).abs() < 1e-6, "{:?}", rays[0]);
        let [x, y, z] = wide(rays[7]);
        assert!((y / x + 0.75 * tan).abs() < 1e-6 && (z / x + 0.25 * tan).abs() < 1e-6);
    }

    #[test]
    fn a_framed_sphere_touches_the_margin() {
        for size in [[64, 64], [96, 32], [32, 80]] {
            let sphere = ([1.0, 2.0, 3.0], 0.5);
            let camera = Camera::framing(sphere, [0.7, 0.4], 0.69, size, 0.1).unwrap();
            let surface = super::super::Surface::sphere(&camera, sphere, size[0], size[1]).unwrap();
            let hit = surface.pixels();
            let side = size[0].min(size[1]) as f64;
            // a disc of diameter 0.9 side, seen at its true perspective size
            let expected = std::f64::consts::PI * (0.45 * side).powi(2);
            assert!((hit as f64 / expected - 1.0).abs() < 0.04, "{size:?}: {hit} pixels, not {expected}");
        }
    }

    #[test]
    fn cameras_survive_json_and_broken_ones_do_not() {
        let camera = Camera::look_at([3.0, 1.0, 2.0], [0.0; 3], 0.5).unwrap();
        assert_eq!(Camera::from_json(&camera.to_json()).unwrap(), camera);
        let skewed = Camera { up: camera.forward, ..camera };
        assert!(Camera::from_json(&skewed.to_json()).unwrap_err().to_string().contains("orthonormal"));
        assert!(Camera::from_json("{}").is_err());
        assert!(Camera::look_at([1.0; 3], [1.0; 3], 0.5).is_err());
        assert!(Camera::look_at([0.0; 3], [1.0; 3], 4.0).is_err());
        // straight down still has a right
        assert_eq!(Camera::look_at([0.0, 0.0, 1.0], [0.0; 3], 0.5).unwrap().right, [0.0, -1.0, 0.0]);
    }
}
