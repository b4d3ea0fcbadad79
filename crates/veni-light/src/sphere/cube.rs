//! Cube maps as graphics APIs define them (Direct3D, Vulkan, Metal, OpenGL, WebGPU alike).
//!
//! Faces are ordered +X −X +Y −Y +Z −Z; texel (column, row) of a face of `size` texels has s = (column + ½)/size
//! to the right and t = (row + ½)/size downwards. With a = 2s − 1 and b = 2t − 1 the lookup vector is
//!
//! | face | +X | −X | +Y | −Y | +Z | −Z |
//! |---|---|---|---|---|---|---|
//! | vector | (1, −b, −a) | (−1, −b, a) | (a, 1, b) | (a, −1, −b) | (a, −b, 1) | (−a, −b, −1) |

use super::Frame;
use crate::vector::unit;

/// One face of a cube map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CubeFace {
    /// +X, layer 0.
    PosX,
    /// −X, layer 1.
    NegX,
    /// +Y, layer 2.
    PosY,
    /// −Y, layer 3.
    NegY,
    /// +Z, layer 4.
    PosZ,
    /// −Z, layer 5.
    NegZ,
}

impl CubeFace {
    /// All faces in the order of array layers.
    pub const ALL: [Self; 6] = [Self::PosX, Self::NegX, Self::PosY, Self::NegY, Self::PosZ, Self::NegZ];

    /// Short name for file names: px nx py ny pz nz.
    pub fn name(self) -> &'static str {
        ["px", "nx", "py", "ny", "pz", "nz"][self as usize]
    }

    /// The lookup vector (not normalised, largest component ±1) at a, b ∈ [−1, 1], a to the right, b downwards.
    #[inline]
    pub fn lookup(self, a: f64, b: f64) -> [f64; 3] {
        match self {
            Self::PosX => [1.0, -b, -a],
            Self::NegX => [-1.0, -b, a],
            Self::PosY => [a, 1.0, b],
            Self::NegY => [a, -1.0, -b],
            Self::PosZ => [a, -b, 1.0],
            Self::NegZ => [-a, -b, -1.0],
        }
    }

    /// Unit native direction of a texel's centre, for software whose directions are those of `frame` and which
    /// uses them as lookup vectors unchanged (for [`Frame::Bevy`]: with z negated, as Bevy's shaders do).
    ///
    /// # Panics
    /// If the texel lies outside the face.
    pub fn direction(self, frame: Frame, size: usize, column: usize, row: usize) -> [f32; 3] {
        assert!(column < size && row < size, "texel ({column}, {row}) of a face of {size} × {size}");
        let centre = |k: usize| (2 * k + 1) as f64 / size as f64 - 1.0;
        self.towards(frame, centre(column), centre(row)).map(|c| c as f32)
    }

    /// Unit native direction of the place (a, b) of [`CubeFace::lookup`]; see [`CubeFace::direction`].
    pub(crate) fn towards(self, frame: Frame, a: f64, b: f64) -> [f64; 3] {
        let mut v = self.lookup(a, b);
        if frame == Frame::Bevy {
            v[2] = -v[2];
        }
        frame.permuted(unit(v))
    }

    /// All unit native directions of a face, row-major; see [`CubeFace::direction`].
    pub fn directions(self, frame: Frame, size: usize) -> Vec<[f32; 3]> {
        (0..size * size).map(|k| self.direction(frame, size, k % size, k / size)).collect()
    }

    /// Exact solid angle of a texel, steradians, the same on every face; all 6·size² of them sum to 4π.
    ///
    /// # Panics
    /// If the texel lies outside the face.
    pub fn solid_angle(size: usize, column: usize, row: usize) -> f64 {
        assert!(column < size && row < size, "texel ({column}, {row}) of a face of {size} × {size}");
        // solid angle of the rectangle from the face's centre to (a, b)
        let corner = |i: usize, j: usize| {
            let (a, b) = (2.0 * i as f64 / size as f64 - 1.0, 2.0 * j as f64 / size as f64 - 1.0);
            (a * b).atan2((a * a + b * b + 1.0).sqrt())
        };
        let (i, j) = (column, row);
        corner(i + 1, j + 1) - corner(i, j + 1) - corner(i + 1, j) + corner(i, j)
    }

    /// The solid angle of every texel of a face, row-major. A quarter of the face is its mirror images, and half of that again.
    #[cfg(any(test, feature = "prefilter"))]
    pub(crate) fn solid_angles(size: usize) -> Vec<f64> {
        let half = size.div_ceil(2);
        let mut corners = vec![0.0; (half + 1) * (half + 1)];
        for j in 0..=half {
            for i in 0..=j {
                let (a, b) = (2.0 * i as f64 / size as f64 - 1.0, 2.0 * j as f64 / size as f64 - 1.0);
                let corner = (a * b).atan2((a * a + b * b + 1.0).sqrt());
                corners[j * (half + 1) + i] = corner;
                corners[i * (half + 1) + j] = corner;
            }
        }
        let mut areas = vec![0.0; size * size];
        for j in 0..half {
            for i in 0..half {
                let corner = |i: usize, j: usize| corners[j * (half + 1) + i];
                let area = corner(i + 1, j + 1) - corner(i, j + 1) - corner(i + 1, j) + corner(i, j);
                for row in [j, size - 1 - j] {
                    for column in [i, size - 1 - i] {
                        areas[row * size + column] = area;
                    }
                }
            }
        }
        areas
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn solid_angles_sum_to_the_whole_sphere() {
        for size in [1, 2, 7, 64] {
            let face: f64 = (0..size * size).map(|k| CubeFace::solid_angle(size, k % size, k / size)).sum();
            assert!((6.0 * face - 4.0 * PI).abs() < 1e-11, "{size}: {face}");
        }
        // the differential 4/(size² r³) at the centre
        let exact = CubeFace::solid_angle(1001, 500, 500);
        assert!((exact - 4.0 / 1001f64.powi(2)).abs() < 1e-5 * exact);
    }

    #[test]
    fn face_centres_look_along_their_axes() {
        for (face, axis) in CubeFace::ALL.into_iter().zip([
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ]) {
            assert_eq!(face.lookup(0.0, 0.0).map(|v| v + 0.0), axis);
            assert_eq!(face.direction(Frame::Gltf, 1, 0, 0), Frame::Gltf.to_native(axis.map(|v| v as f32)));
        }
    }

    /// Every edge of every face is shared with exactly one other: the same points of the cube are found on it.
    #[test]
    fn edges_are_continuous() {
        let edge = |side: usize, k: f64| [[k, -1.0], [k, 1.0], [-1.0, k], [1.0, k]][side];
        for face in CubeFace::ALL {
            for side in 0..4 {
                let neighbours = CubeFace::ALL.into_iter().filter(|&other| {
                    other != face
                        && [-0.75, 0.1, 0.6].into_iter().all(|k| {
                            let [a, b] = edge(side, k);
                            let p = face.lookup(a, b);
                            (0..4).any(|s| {
                                [-0.75, 0.75, 0.1, -0.1, 0.6, -0.6].into_iter().any(|m| {
                                    let [a, b] = edge(s, m);
                                    let q = other.lookup(a, b);
                                    p.iter().zip(q).all(|(x, y)| (x - y).abs() < 1e-12)
                                })
                            })
                        })
                });
                assert_eq!(neighbours.count(), 1, "{face:?}, side {side}");
            }
        }
    }

    /// Seen from inside with y up, left-handed as the APIs have it: on +Z, right is +x and down is −y.
    #[test]
    fn texels_near_corners() {
        let d = CubeFace::PosZ.direction(Frame::Gltf, 2, 1, 0);
        let [x, y, z] = Frame::Gltf.from_native(d);
        assert!(x > 0.0 && y > 0.0 && z > 0.0);
        // Bevy's camera looks along −z and finds face +Z there, right at +x
        let d = CubeFace::PosZ.direction(Frame::Bevy, 3, 2, 1);
        let [x, y, z] = Frame::Bevy.from_native(d);
        assert!(x > 0.0 && y.abs() < 1e-6 && z < 0.0);
    }

    #[test]
    fn solid_angles_of_a_face_are_those_of_its_texels() {
        for size in [1, 2, 3, 8, 17] {
            for (k, area) in CubeFace::solid_angles(size).into_iter().enumerate() {
                assert!(
                    (area - CubeFace::solid_angle(size, k % size, k / size)).abs() < 1e-14,
                    "{size}: {k}"
                );
            }
        }
    }
}
