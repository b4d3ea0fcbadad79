//! Wavefront OBJ files: all objects of one as a mesh in the native frame.

mod polygon;

use std::path::Path;

use anyhow::{Result, anyhow, bail};
use clap::ValueEnum;
use veni_fit::shade::Mesh;
use veni_light::limits::{at_most, read_file};
use veni_light::text;
use veni_light::vector::{length, sub};

use polygon::triangles;

/// Bytes of an OBJ file: the largest scans have a few hundred MB.
const MAX_OBJ_BYTES: u64 = 1 << 30;
/// Corners of its faces, each of which takes some 100 bytes in memory and two in the file: a scan of 11 million triangles.
const MAX_OBJ_CORNERS: u64 = 1 << 25;
/// A mesh whose centre is farther away than this many times its size loses digits in single precision that are seen
/// (2⁻²⁴ of the distance): it is moved to the origin first.
const FAR: f64 = 16.0;

/// Bytes of memory for each of them, in the parser's lists, in ours and in the search tree: measured.
const CORNER_BYTES: u64 = 200;

/// Which axis of a mesh points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Up {
    /// As most OBJ files have it
    #[default]
    Y,
    /// As in this program
    Z,
}

/// A mesh, and the point of the file's coordinates that is its origin.
pub(super) struct Placed {
    pub(super) mesh: Mesh,
    pub(super) origin: [f64; 3],
}

/// Refuses what memory does not hold, before the parser asks for it: it ends the process where it gets none.
fn fits(corners: usize) -> veni_light::Result<()> {
    let needed = corners as u64 * CORNER_BYTES;
    let left = veni_image::memory::available().unwrap_or(u64::MAX);
    if needed <= left {
        return Ok(());
    }
    let [need, have] = [needed, left].map(|bytes| bytes >> 20);
    Err(veni_light::Error::beyond(
        format!(
            "its {corners} corners of faces need {need} MiB of memory, and {have} MiB are available: simplify the mesh"
        ),
        needed,
        left,
    ))
}

/// Reads a file; every triangle has three vertices of its own.
pub(super) fn read(path: &Path, up: Up) -> Result<Placed> {
    let bytes = read_file(path, "a Wavefront OBJ file that is read", MAX_OBJ_BYTES)?;
    let text =
        decode(bytes).ok_or_else(|| anyhow!("{}: is not text: a Wavefront OBJ file is", path.display()))?;
    let text = statements(&text);
    let [with, without] = corners(&text);
    at_most("corners of faces", (with + without) as u64, MAX_OBJ_CORNERS).map_err(|e| e.in_file(path))?;
    fits(with + without).map_err(|e| e.in_file(path))?;
    if names_zero(&text) {
        bail!(
            "{}: a face names a vertex, a texture coordinate or a normal by 0: they are counted from 1",
            path.display()
        );
    }
    if with > 0 && without > 0 {
        bail!(
            "{}: {without} of {} corners of faces lack normals: give all of them one, or none",
            path.display(),
            with + without
        );
    }
    let options = tobj::LoadOptions {
        // as fans, which leave a concave face
        triangulate: false,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // materials are not used, and a library may be anywhere: it is not opened
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials)
        .map_err(|e| anyhow!("{}: {}", path.display(), explain(e)))?;
    let native = |v: &[f64]| match up {
        // Frame::Gltf in double precision
        Up::Y => [v[0], -v[2], v[1]],
        Up::Z => [v[0], v[1], v[2]],
    };
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for tobj::Model { mesh, .. } in &models {
        let mut first = 0;
        // nothing is said where all are triangles
        let arities = if mesh.face_arities.is_empty() {
            vec![3; mesh.indices.len() / 3]
        } else {
            mesh.face_arities.clone()
        };
        for arity in arities.into_iter().map(|n| n as usize) {
            let corner = |at: &u32| native(&mesh.positions[3 * *at as usize..]);
            let corners: Vec<_> = mesh.indices[first..first + arity].iter().map(corner).collect();
            for at in triangles(&corners).map_err(|e| e.in_file(path))?.into_iter().flatten() {
                positions.push(corners[at]);
                if with > 0 {
                    // what looks like the number of a normal may be none to the parser
                    let number = mesh.normal_indices.get(first + at).map(|number| 3 * *number as usize);
                    let normal = number.and_then(|at| mesh.normals.get(at..at + 3));
                    let normal = normal.ok_or_else(|| {
                        anyhow!("{}: a corner of a face names a normal that is not there", path.display())
                    })?;
                    normals.push(native(normal).map(|c| c as f32));
                }
            }
            first += arity;
        }
    }
    let count = u32::try_from(positions.len())
        .map_err(|_| anyhow!("{}: more than {} corners of triangles", path.display(), u32::MAX))?;
    let triangles = (0..count / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let origin = far_centre(&positions);
    let moved = |[x, y, z]: [f64; 3]| [x - origin[0], y - origin[1], z - origin[2]].map(|c| c as f32);
    let positions = positions.into_iter().map(moved).collect();
    Ok(Placed { mesh: Mesh { positions, normals: (with > 0).then_some(normals), triangles }, origin })
}

/// Names and comments may be in any of the old code pages, of which nothing here is used: what is not UTF-8 is read all the same,
/// if there is a vertex in it. No text has a zero byte.
fn decode(bytes: Vec<u8>) -> Option<String> {
    let is_marked = matches!(bytes.as_slice(), [0xff, 0xfe, ..] | [0xfe, 0xff, ..]);
    if is_marked || !bytes.contains(&0) && std::str::from_utf8(&bytes).is_ok() {
        return text::decode(bytes).ok();
    }
    let text = (!bytes.contains(&0)).then(|| text::line_ends(String::from_utf8_lossy(&bytes).into_owned()));
    text.filter(|text| text.lines().any(|line| line.trim_start().starts_with("v ")))
}

/// The middle of the points where it is far from the origin; else the origin.
fn far_centre(points: &[[f64; 3]]) -> [f64; 3] {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for c in 0..3 {
            (low[c], high[c]) = (low[c].min(point[c]), high[c].max(point[c]));
        }
    }
    let centre: [f64; 3] = std::array::from_fn(|c| 0.5 * (low[c] + high[c]));
    let size = length(sub(high, low));
    let is_far = length(centre) > FAR * size && centre.iter().all(|c| c.is_finite());
    if is_far { centre } else { [0.0; 3] }
}

/// One statement per line: without comments, and continued lines in one.
fn statements(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim_end();
        match line.strip_suffix('\\') {
            Some(begun) => out.extend([begun, " "]),
            None => out.extend([line, "\n"]),
        }
    }
    out
}

/// How many corners of faces name a normal, and how many do not. The reader would make one up for those.
fn corners(statements: &str) -> [usize; 2] {
    let mut counts = [0; 2];
    let words = statements.lines().map(str::split_whitespace);
    let faces = words.filter_map(|mut words| (words.next() == Some("f")).then_some(words));
    for corner in faces.flatten() {
        let named = corner.split('/').nth(2).is_some_and(|n| !n.is_empty());
        counts[usize::from(!named)] += 1;
    }
    counts
}

/// Whether a face names something by 0: numbers begin at 1, or at -1 from the end.
fn names_zero(statements: &str) -> bool {
    let faces = statements.lines().filter_map(|line| line.trim_start().strip_prefix("f "));
    faces.flat_map(str::split_whitespace).any(|corner| corner.split('/').any(|number| number == "0"))
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

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Frame;

    #[test]
    fn statements_are_whole_and_without_comments() {
        let text = "# head\nv 1 2 \\\n3 # up\r\nf 1 2 3# side\nv 4 5 6";
        assert_eq!(statements(text), "\nv 1 2  3\nf 1 2 3\nv 4 5 6\n");
        assert_eq!(corners(&statements("f 1//1 2//1 \\\n 3//1 # f 4 5 6\nf 1 2/3 3/4/5")), [4, 2]);
    }

    #[test]
    fn comments_of_any_code_page_are_read_past() {
        let text = decode(b"# W\xfcrfel\nv 1 2 3\n".to_vec()).unwrap();
        assert_eq!(statements(&text), "\nv 1 2 3\n");
        assert_eq!(decode(b"\xef\xbb\xbfv 1 2 3".to_vec()).unwrap(), "v 1 2 3");
        for name in [&b"W\xfcrfel"[..], b"cube"] {
            let bytes = [b"# ", name, b"\rv 1 2 3\rv 4 5 6\r"].concat();
            assert_eq!(
                statements(&decode(bytes).unwrap()),
                "\nv 1 2 3\nv 4 5 6\n",
                "lines that end in CR alone"
            );
        }
        assert_eq!((decode(b"v 1\0".to_vec()), decode(b"\xe9\0".to_vec())), (None, None));
    }

    #[test]
    fn double_precision_rotates_as_single_precision_does() {
        let path = tempfile::tempdir().unwrap();
        let path = path.path().join("a.obj");
        std::fs::write(&path, "v 1 2 3\nv 4 5 6\nv 7 8 10\nf 1 2 3\n").unwrap();
        let Placed { mesh, origin } = read(&path, Up::Y).unwrap();
        assert_eq!((mesh.positions[0], origin), (Frame::Gltf.to_native([1.0, 2.0, 3.0]), [0.0; 3]));
        std::fs::write(&path, "v 5e6 4e6 100.25\nv 5000001 4e6 100.5\nv 5e6 4000001 100\nf 1 2 3\n").unwrap();
        let Placed { mesh, origin } = read(&path, Up::Z).unwrap();
        assert_eq!(origin, [5_000_000.5, 4_000_000.5, 100.25]);
        assert_eq!(mesh.positions[1], [0.5, -0.5, 0.25]);
    }

    /// A normal that is not there is an error, and none where the text has only its slashes.
    #[test]
    fn a_normal_that_is_none_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        let of = |face: &str| {
            std::fs::write(&path, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n{face}\n")).unwrap();
            read(&path, Up::Z).map(|placed| placed.mesh.normals).map_err(|e| e.to_string())
        };
        assert!(of("f 1//9 2//9 3//9").unwrap_err().contains("a.obj"));
        for face in ["f 1//x 2//x 3//x", "f 1//0 2//0 3//0", "f 1/1/ 2/1/ 3/1/", "f 1//- 2//- 3//-"] {
            assert!(of(face).map_or_else(|e| e.contains("a.obj"), |normals| normals.is_none()), "{face}");
        }
    }

    /// An L of three squares, whose fan from most of its corners would be another shape.
    #[test]
    fn concave_faces_keep_their_shape_and_their_normals() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("l.obj");
        let corners = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
        let of = |from: usize, normals: bool| {
            let mut text: String = corners.iter().map(|[x, y]| format!("v {x} {y} 5\n")).collect();
            text += &corners.iter().map(|[x, y]| format!("vn {x} {y} 1\n")).collect::<String>();
            let at = (0..6).map(|k| (from + k) % 6 + 1);
            let named = at.map(|k| if normals { format!(" {k}//{k}") } else { format!(" {k}") });
            std::fs::write(&path, format!("{text}f{}\nf 1 2 3\n", named.collect::<String>())).unwrap();
            if normals {
                let text = std::fs::read_to_string(&path).unwrap().replace("f 1 2 3", "f 1//1 2//2 3//3");
                std::fs::write(&path, text).unwrap();
            }
            read(&path, Up::Z).unwrap().mesh
        };
        let area = |mesh: &Mesh| -> f32 {
            let twice = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|at| mesh.positions[at as usize]);
                (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
            };
            assert!(mesh.triangles.iter().all(|t| twice(t) > 0.0), "all of one winding");
            mesh.triangles.iter().map(|t| 0.5 * twice(t)).sum()
        };
        for from in 0..6 {
            for normals in [true, false] {
                let mesh = of(from, normals);
                assert_eq!((area(&mesh), mesh.triangles.len()), (3.0 + 1.0, 5), "from corner {from}");
                let own = |(p, n): (&[f32; 3], &[f32; 3])| p[..2] == n[..2];
                assert!(mesh.normals.iter().all(|normals| mesh.positions.iter().zip(normals).all(own)));
            }
        }
    }
}
