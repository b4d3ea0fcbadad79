//! What a camera sees of a shape: a normal and a ray for every pixel.

use super::unit::{unit, unit_f32};
use super::{Camera, NormalMap};
use crate::{Error, Result};
use veni_light::vector::{add, dot, narrow, scaled, sub, wide};

/// An image of W × H pixels, row-major, some of which show the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    width: usize,
    height: usize,
    normals: Vec<[f32; 3]>,
    rays: Vec<[f32; 3]>,
    valid: Vec<bool>,
}

impl Surface {
    /// From normals and rays, [H·W, 3] each. Rays point *away* from the camera; both are normalised here. A pixel shows
    /// the surface if its normal has a length between 0.5 and 1.5 (as in the reference implementation: interpolated normals
    /// at an edge are too short) and `mask`, if given, says so.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the sizes disagree, if a visible pixel's ray is zero or not finite, or if no pixel shows
    /// anything.
    pub fn new(
        [width, height]: [usize; 2],
        normals: &[[f32; 3]],
        rays: &[[f32; 3]],
        mask: Option<&[bool]>,
    ) -> Result<Self> {
        let pixels = width.saturating_mul(height);
        for (what, count) in [
            ("normals", Some(normals.len())),
            ("rays", Some(rays.len())),
            ("mask values", mask.map(<[_]>::len)),
        ] {
            if let Some(count) = count.filter(|n| *n != pixels) {
                return Err(Error::invalid(format!(
                    "{count} {what} for {width} × {height} pixels: all images of a surface must have one size"
                )));
            }
        }
        let mut surface = Self {
            width,
            height,
            normals: vec![[0.0; 3]; pixels],
            rays: rays.to_vec(),
            valid: vec![false; pixels],
        };
        for k in 0..pixels {
            let Some(normal) = NormalMap::valid(normals[k]).filter(|_| mask.is_none_or(|m| m[k])) else {
                continue;
            };
            let ray = unit_f32(rays[k]).ok_or_else(|| {
                Error::invalid(format!("pixel ({}, {}) has ray {:?}", k % width, k / width, rays[k]))
            })?;
            (surface.normals[k], surface.rays[k], surface.valid[k]) = (normal, ray, true);
        }
        if surface.pixels() == 0 {
            return Err(Error::invalid(format!(
                "none of the {width} × {height} pixels shows a surface: a normal has a length between 0.5 and 1.5, and \
                 lies where the mask is white"
            )));
        }
        Ok(surface)
    }

    /// A sphere (centre and radius) seen by a camera.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the camera does not see it.
    pub fn sphere(
        camera: &Camera,
        (centre, radius): ([f64; 3], f64),
        width: usize,
        height: usize,
    ) -> Result<Self> {
        let to_centre = sub(centre, camera.position);
        let rays = camera.rays(width, height);
        let normal = |ray: &[f32; 3]| {
            // nearest root of |t ray − to_centre| = radius
            let ray = wide(*ray);
            let along = dot(ray, to_centre);
            let discriminant = along * along - dot(to_centre, to_centre) + radius * radius;
            let t = along - discriminant.max(0.0).sqrt();
            let hit = discriminant >= 0.0 && t > 0.0;
            let normal = hit.then(|| unit(add(scaled(ray, t), scaled(to_centre, -1.0)))).flatten();
            normal.map_or([0.0; 3], narrow)
        };
        let normals: Vec<_> = rays.iter().map(normal).collect();
        Self::new([width, height], &normals, &rays, None)
    }

    /// Columns, W.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows, H.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Unit normals, row-major; 0 where no surface is seen.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }

    /// Rays, row-major, away from the camera.
    pub fn rays(&self) -> &[[f32; 3]] {
        &self.rays
    }

    /// Which pixels show the surface, row-major.
    pub fn valid(&self) -> &[bool] {
        &self.valid
    }

    /// How many do.
    pub fn pixels(&self) -> usize {
        self.valid.iter().filter(|v| **v).count()
    }
}
