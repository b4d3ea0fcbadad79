//! What is lit: a sphere, or the triangles of an OBJ file, framed by the camera.

use std::path::Path;

use anyhow::{Result, anyhow, bail};
use clap::ValueEnum;
use veni_fit::shade::{Camera, Mesh, REFERENCE_FIELD_OF_VIEW, Surface};
use veni_light::Error;
use veni_light::limits::{at_most, read_file};
use veni_light::sphere::Frame;

use crate::report::Report;

/// Free space around the shape, as a fraction of the image's smaller side.
const MARGIN: f64 = 0.04;

/// Bytes of an OBJ file: the largest scans have a few hundred MB.
const MAX_OBJ_BYTES: u64 = 1 << 30;
/// Corners of its faces, each of which takes some 100 bytes in memory and two in the file: a scan of 11 million triangles.
const MAX_OBJ_CORNERS: u64 = 1 << 25;

/// Which axis of a mesh points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Up {
    /// As most OBJ files have it
    #[default]
    Y,
    /// As in this program
    Z,
}

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
    let mesh = read(path, up)?;
    let see = || {
        let ball = mesh.bounding_sphere()?;
        let camera = Camera::framing(ball, angles, REFERENCE_FIELD_OF_VIEW, [width, height], MARGIN)?;
        Ok((mesh.surface(&camera, width, height)?, camera))
    };
    let seen = see().map_err(|e: Error| e.in_file(path))?;
    if mesh.normals.is_none() {
        report.note(format_args!("{}: has no normals; its faces are flat", path.display()));
    }
    Ok(seen)
}

/// All objects of an OBJ file as one mesh in the native frame, three vertices of its own to each triangle.
fn read(path: &Path, up: Up) -> Result<Mesh> {
    let bytes = read_file(path, "a Wavefront OBJ file that is read", MAX_OBJ_BYTES)?;
    let text = String::from_utf8(bytes)
        .map_err(|_| anyhow!("{}: is not text: a Wavefront OBJ file is", path.display()))?;
    let [with, without] = corners(&text);
    at_most("corners of faces", (with + without) as u64, MAX_OBJ_CORNERS).map_err(|e| e.in_file(path))?;
    if with > 0 && without > 0 {
        bail!(
            "{}: {without} of {} corners of faces lack normals: give all of them one, or none",
            path.display(),
            with + without
        );
    }
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // materials are not used: a missing library is not a reason to fail
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials)
        .map_err(|e| anyhow!("{}: {}", path.display(), explain(e)))?;
    let native = |v: &[f32]| match up {
        Up::Y => Frame::Gltf.to_native([v[0], v[1], v[2]]),
        Up::Z => [v[0], v[1], v[2]],
    };
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for tobj::Model { mesh, .. } in &models {
        positions.extend(mesh.indices.iter().map(|at| native(&mesh.positions[3 * *at as usize..])));
        if with > 0 {
            normals.extend(mesh.normal_indices.iter().map(|at| native(&mesh.normals[3 * *at as usize..])));
        }
    }
    let count = u32::try_from(positions.len())
        .map_err(|_| anyhow!("{}: more than {} corners of triangles", path.display(), u32::MAX))?;
    let triangles = (0..count / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Ok(Mesh { positions, normals: (with > 0).then_some(normals), triangles })
}

/// How many corners of faces name a normal, and how many do not. The reader would make one up for those.
fn corners(text: &str) -> [usize; 2] {
    let mut counts = [0; 2];
    let words = text.lines().map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
    let faces = words.filter_map(|mut words| (words.next() == Some("f")).then_some(words));
    for corner in faces.flatten() {
        let named = corner.split('/').nth(2).is_some_and(|n| !n.is_empty());
        counts[usize::from(!named)] += 1;
    }
    counts
}

/// What is wrong with the file.
fn explain(error: tobj::LoadError) -> String {
    use tobj::LoadError as E;
    let what = match error {
        E::FaceVertexOutOfBounds => "a face names a vertex that is not in the file",
        E::FaceNormalOutOfBounds => "a face names a normal that is not in the file",
        E::FaceTexCoordOutOfBounds => "a face names a texture coordinate that is not in the file",
        E::PositionParseError => "a vertex is not three numbers",
        E::NormalParseError => "a normal is not three numbers",
        E::FaceParseError | E::InvalidPolygon => "a face is not a list of at least three vertices",
        other => return format!("no readable Wavefront OBJ file: {other}"),
    };
    what.to_owned()
}
