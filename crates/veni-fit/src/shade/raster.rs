//! Triangle meshes, drawn with a depth buffer.

use rayon::prelude::*;

use super::unit::unit;
use super::{Camera, Surface};
use crate::{Error, Result};
use veni_light::vector::{add, cross, dot, length, narrow, scaled, sub, wide};

/// Triangles in space. Corners are in any order of rotation: the side that faces the camera is the outer one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Vertex normals of any length, one per position; one of length 0 stands for the triangle's own. Without them every
    /// triangle is flat.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Three positions each.
    pub triangles: Vec<[u32; 3]>,
}

/// A triangle as the camera at the origin of space sees it.
struct Triangle {
    /// Corners relative to the camera.
    corners: [[f64; 3]; 3],
    /// Corner normals, or the flat one three times.
    normals: [[f64; 3]; 3],
    /// Unit normal of its plane.
    plane: [f64; 3],
    /// Columns and rows that may show it, ends excluded.
    columns: [usize; 2],
    rows: [usize; 2],
}

impl Mesh {
    /// A sphere around all vertices: the centre of their box, and the distance of the farthest.
    ///
    /// # Errors
    /// As [`Mesh::check`].
    pub fn bounding_sphere(&self) -> Result<([f64; 3], f64)> {
        self.check()?;
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        // vertices of no triangle are not seen
        let used = || self.triangles.iter().flatten().map(|at| wide(self.positions[*at as usize]));
        for p in used() {
            for c in 0..3 {
                (low[c], high[c]) = (low[c].min(p[c]), high[c].max(p[c]));
            }
        }
        let centre = scaled(add(low, high), 0.5);
        let radius = used().map(|p| length(sub(p, centre))).fold(0.0, f64::max);
        if radius == 0.0 {
            return Err(Error::invalid("the mesh is a single point: there is nothing to see"));
        }
        Ok((centre, radius))
    }

    /// Whether it can be drawn at all.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are no triangles, if one names a vertex that is not there, if a number is not finite
    /// or if there is not one normal per position.
    pub fn check(&self) -> Result<()> {
        let n = self.positions.len();
        if self.triangles.is_empty() {
            return Err(Error::invalid(format!("the mesh has {n} vertices and no triangles: it is empty")));
        }
        if let Some(wrong) = self.triangles.iter().flatten().find(|at| **at as usize >= n) {
            return Err(Error::invalid(format!("a triangle names vertex {wrong} of {n} (counted from 0)")));
        }
        if let Some(wrong) = self.positions.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
            return Err(Error::invalid(format!("vertex {wrong} lies at {:?}", self.positions[wrong])));
        }
        if let Some(normals) = &self.normals {
            if normals.len() != n {
                return Err(Error::invalid(format!("{} normals for {n} vertices", normals.len())));
            }
            if let Some(wrong) = normals.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
                return Err(Error::invalid(format!("vertex {wrong} has normal {:?}", normals[wrong])));
            }
        }
        Ok(())
    }

    /// The mesh seen by a camera: at every pixel centre the nearest triangle's normal, interpolated in space between its
    /// corners and turned to the camera's side.
    ///
    /// # Errors
    /// As [`Mesh::check`]; [`Error::Invalid`] if the camera sees none of it.
    pub fn surface(&self, camera: &Camera, width: usize, height: usize) -> Result<Surface> {
        self.check()?;
        let triangles: Vec<_> =
            self.triangles.iter().filter_map(|t| self.triangle(camera, *t, width, height)).collect();
        let rays = camera.rays(width, height);
        let mut normals = vec![[0.0; 3]; width * height];
        normals.par_chunks_exact_mut(width).enumerate().for_each(|(row, out)| {
            let mut depth = vec![f64::INFINITY; width];
            for triangle in triangles.iter().filter(|t| (t.rows[0]..t.rows[1]).contains(&row)) {
                for column in triangle.columns[0]..triangle.columns[1] {
                    // the ray as a point at depth 1, not the rounded one, so that neighbours share their edge exactly
                    let ray = camera.ray(width, height, column, row);
                    if let Some((t, normal)) = triangle.hit(ray)
                        && t < depth[column]
                    {
                        (depth[column], out[column]) = (t, narrow(normal));
                    }
                }
            }
        });
        Surface::new([width, height], &normals, &rays, None)
    }

    /// `None` for what cannot be seen: without area, or outside the image.
    fn triangle(&self, camera: &Camera, corners: [u32; 3], width: usize, height: usize) -> Option<Triangle> {
        let at = corners.map(|k| k as usize);
        let corners = at.map(|k| sub(wide(self.positions[k]), camera.position));
        let plane = unit(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])))?;
        let normals = match &self.normals {
            Some(normals) => at.map(|k| unit(wide(normals[k])).unwrap_or(plane)),
            None => [plane; 3],
        };
        let (w, h) = (width as f64, height as f64);
        let pixels_per_tangent = 0.5 * w / (0.5 * camera.field_of_view).tan();
        let depths = corners.map(|p| dot(p, camera.forward));
        if depths.iter().all(|d| *d <= 0.0) {
            return None;
        }
        let (mut low, mut high) = ([0.0, 0.0], [w, h]);
        // behind the camera there is no projection: such a triangle may be anywhere
        if depths.iter().all(|d| *d > 1e-9) {
            (low, high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for (p, d) in corners.iter().zip(depths) {
                let x = 0.5 * w + pixels_per_tangent * dot(*p, camera.right) / d;
                let y = 0.5 * h - pixels_per_tangent * dot(*p, camera.up) / d;
                low = [low[0].min(x), low[1].min(y)];
                high = [high[0].max(x), high[1].max(y)];
            }
        }
        // pixel centres from low to high, with one to spare for rounding
        let span = |a: f64, b: f64, size: f64| {
            [(a - 1.0).floor().clamp(0.0, size) as usize, (b + 1.0).ceil().clamp(0.0, size) as usize]
        };
        let (columns, rows) = (span(low[0], high[0], w), span(low[1], high[1], h));
        (columns[0] < columns[1] && rows[0] < rows[1]).then_some(Triangle {
            corners,
            normals,
            plane,
            columns,
            rows,
        })
    }
}

impl Triangle {
    /// Distance along a unit ray from the camera, and the unit normal there.
    fn hit(&self, ray: [f64; 3]) -> Option<(f64, [f64; 3])> {
        let [a, b, c] = self.corners;
        // volumes spanned with the ray: barycentric weights, with one sign inside; two triangles compute the same number
        // (but for its sign) for the edge that they share
        let weights = [dot(ray, cross(b, c)), dot(ray, cross(c, a)), dot(ray, cross(a, b))];
        let inside = weights.iter().all(|w| *w >= 0.0) || weights.iter().all(|w| *w <= 0.0);
        let total: f64 = weights.iter().sum();
        if !inside || total == 0.0 {
            return None;
        }
        let facing = dot(self.plane, ray);
        let t = dot(self.plane, a) / facing;
        if !(t > 0.0 && t.is_finite()) {
            return None;
        }
        let outward = if facing > 0.0 { scaled(self.plane, -1.0) } else { self.plane };
        let parts = [0, 1, 2].map(|k| scaled(self.normals[k], weights[k] / total));
        let normal = unit(add(add(parts[0], parts[1]), parts[2])).unwrap_or(outward);
        Some((t, if dot(normal, outward) < 0.0 { scaled(normal, -1.0) } else { normal }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// The unit sphere in cells of latitude and longitude.
    fn ball(rows: usize, smooth: bool) -> Mesh {
        let columns = 2 * rows;
        let mut positions = Vec::new();
        for j in 0..=rows {
            let (sin_t, cos_t) = (PI * j as f64 / rows as f64).sin_cos();
            for i in 0..columns {
                let (sin_p, cos_p) = (2.0 * PI * i as f64 / columns as f64).sin_cos();
                positions.push(narrow([sin_t * cos_p, sin_t * sin_p, cos_t]));
            }
        }
        let mut triangles = Vec::new();
        for j in 0..rows {
            for i in 0..columns {
                let at = |j: usize, i: usize| (j * columns + i % columns) as u32;
                triangles.push([at(j, i), at(j + 1, i), at(j + 1, i + 1)]);
                triangles.push([at(j, i), at(j + 1, i + 1), at(j, i + 1)]);
            }
        }
        let normals = smooth.then(|| positions.clone());
        Mesh { positions, normals, triangles }
    }

    #[test]
    fn a_fine_mesh_of_a_sphere_is_the_sphere_without_holes() {
        let camera = Camera::framing(([0.0; 3], 1.0), [0.3, 0.5], 0.69, [48, 48], 0.05).unwrap();
        let exact = Surface::sphere(&camera, ([0.0; 3], 1.0), 48, 48).unwrap();
        for (smooth, tolerance) in [(true, 2e-3), (false, 0.06)] {
            let drawn = ball(60, smooth).surface(&camera, 48, 48).unwrap();
            let mut edge = 0;
            for k in 0..48 * 48 {
                if drawn.valid()[k] != exact.valid()[k] {
                    // only the silhouette of the polygons differs
                    edge += 1;
                    let facing = dot(wide(exact.normals()[k]), wide(exact.rays()[k]));
                    assert!(facing > -0.1, "a hole at pixel {k}");
                } else if drawn.valid()[k] {
                    let difference = sub(wide(drawn.normals()[k]), wide(exact.normals()[k]));
                    // seen at a slant, the same distance in space is a larger one on the sphere
                    let facing = -dot(wide(exact.normals()[k]), wide(exact.rays()[k]));
                    assert!(length(difference) * facing < tolerance, "pixel {k}: off by {difference:?}");
                }
            }
            assert!(edge < 20, "{edge} pixels of the outline differ");
        }
    }

    #[test]
    fn the_nearer_triangle_is_seen_from_either_side() {
        let square = |x: f32, flip: bool| {
            let corners = [[x, -1.0, -1.0], [x, 1.0, -1.0], [x, 1.0, 1.0], [x, -1.0, 1.0]];
            (corners, if flip { [[2, 1, 0], [3, 2, 0]] } else { [[0, 1, 2], [0, 2, 3]] })
        };
        let camera = Camera::look_at([-4.0, 0.0, 0.0], [0.0; 3], 0.3).unwrap();
        for flip in [false, true] {
            // a slanted normal tells the far square from the near one
            let ((near, triangles), (far, _)) = (square(0.0, flip), square(1.0, flip));
            let positions: Vec<_> = far.into_iter().chain(near).collect();
            let normals = [[[1.0, 1.0, 0.0]; 4], [[1.0, 0.0, 0.0]; 4]].concat();
            let second = triangles.map(|t: [u32; 3]| t.map(|k| k + 4));
            let triangles = [triangles, second].concat();
            let mesh = Mesh { positions, normals: Some(normals), triangles };
            let surface = mesh.surface(&camera, 9, 9).unwrap();
            assert!(surface.normals().iter().all(|n| *n == [-1.0, 0.0, 0.0]), "{:?}", surface.normals());
        }
    }

    #[test]
    fn a_triangle_that_reaches_behind_the_camera_is_drawn() {
        // a floor, far and wide
        let positions = vec![[-100.0, -100.0, 0.0], [100.0, -100.0, 0.0], [0.0, 200.0, 0.0]];
        let mesh = Mesh { positions, normals: None, triangles: vec![[0, 1, 2]] };
        let camera = Camera::look_at([0.0, 0.0, 1.0], [1.0, 0.0, 1.0], 1.0).unwrap();
        let surface = mesh.surface(&camera, 8, 8).unwrap();
        assert!(surface.valid()[32..].iter().all(|v| *v) && surface.valid()[..32].iter().all(|v| !v));
        assert_eq!(surface.normals()[60], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn meshes_that_are_none_are_refused() {
        let message = |m: &Mesh| m.bounding_sphere().unwrap_err().to_string();
        let point = Mesh { positions: vec![[1.0; 3]], normals: None, triangles: vec![[0, 0, 0]] };
        assert!(message(&Mesh::default()).contains("empty"));
        assert!(message(&point).contains("single point"));
        assert!(message(&Mesh { triangles: vec![[0, 0, 1]], ..point.clone() }).contains("vertex 1 of 1"));
        assert!(message(&Mesh { normals: Some(vec![]), ..point.clone() }).contains("0 normals"));
        assert!(message(&Mesh { positions: vec![[f32::NAN; 3]], ..point }).contains("NaN"));
        let camera = Camera::look_at([5.0, 0.0, 0.0], [9.0, 0.0, 0.0], 0.3).unwrap();
        assert!(ball(4, true).surface(&camera, 4, 4).unwrap_err().to_string().contains("none of"));
    }
}
