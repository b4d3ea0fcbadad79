//! What is lit: a sphere, or the triangles of an OBJ file, framed by the camera.

use std::path::Path;

use anyhow::Result;
use veni_fit::shade::{Camera, REFERENCE_FIELD_OF_VIEW, Surface};
use veni_light::Error;

use super::obj::{self, Placed, Up};
use crate::report::Report;

/// Free space around the shape, as a fraction of the image's smaller side.
const MARGIN: f64 = 0.04;

/// A unit sphere seen from the angles [azimuth, elevation].
pub(super) fn sphere(angles: [f64; 2], [width, height]: [usize; 2]) -> Result<(Surface, Camera)> {
    let ball = ([0.0; 3], 1.0);
    let camera = Camera::framing(ball, angles, REFERENCE_FIELD_OF_VIEW, [width, height], MARGIN)?;
    Ok((Surface::sphere(&camera, ball, width, height)?, camera))
}

/// A mesh seen from the angles [azimuth, elevation].
pub(super) fn mesh(
    path: &Path,
    up: Up,
    angles: [f64; 2],
    [width, height]: [usize; 2],
    report: Report,
) -> Result<(Surface, Camera)> {
    let Placed { mesh, origin } = obj::read(path, up)?;
    let see = || {
        let ball = mesh.bounding_sphere()?;
        let camera = Camera::framing(ball, angles, REFERENCE_FIELD_OF_VIEW, [width, height], MARGIN)?;
        let surface = mesh.surface(&camera, width, height)?;
        let [x, y, z] = camera.position;
        let position = [x + origin[0], y + origin[1], z + origin[2]];
        Ok((surface, Camera { position, ..camera }))
    };
    let seen = see().map_err(|e: Error| e.in_file(path))?;
    if mesh.normals.is_none() {
        report.note(format_args!("{}: has no normals; its faces are flat", path.display()));
    }
    Ok(seen)
}
