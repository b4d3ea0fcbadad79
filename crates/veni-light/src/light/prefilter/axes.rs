//! Which way a renderer looks into a cube map.

use crate::sphere::Frame;

/// The native direction of a cube map's lookup vectors: a permutation of the axes with signs. A cube is seen mirrored where it
/// was made for other axes; each is tested by six labelled directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CubeAxes {
    /// For x, y, z native: which component of the lookup vector, and whether it is negated.
    rows: [(usize, bool); 3],
}

impl CubeAxes {
    /// glTF's axes, lookup vectors used unchanged (glTF-IBL-Sampler, wgpu programs with y up): v = (nx, nz, −ny).
    pub const GLTF: Self = Self { rows: [(0, false), (2, true), (1, false)] };
    /// Filament and OpenEXR cube maps: v = (ny, nz, nx).
    pub const FILAMENT: Self = Self { rows: [(2, false), (0, false), (1, false)] };
    /// Bevy, whose shaders negate z before the lookup: v = (−ny, nz, nx).
    pub const BEVY: Self = Self { rows: [(2, false), (0, true), (1, false)] };
    /// A cube texture of the user's in three.js, which negates x before the lookup: v = (−nx, nz, −ny).
    pub const THREE: Self = Self { rows: [(0, true), (2, true), (1, false)] };
    /// Babylon.js, left-handed: v = (−ny, nz, nx).
    pub const BABYLON: Self = Self::BEVY;
    /// z up, lookup vectors are native directions.
    pub const NATIVE: Self = Self { rows: [(0, false), (1, false), (2, false)] };

    /// As [`CubeFace::direction`](crate::sphere::CubeFace::direction) has it for a frame.
    pub fn of(frame: Frame) -> Self {
        match frame {
            Frame::Blender => Self::NATIVE,
            Frame::Gltf => Self::GLTF,
            Frame::OpenExr => Self::FILAMENT,
            Frame::Bevy => Self::BEVY,
        }
    }

    /// The native direction (of the same length) of a lookup vector.
    #[inline]
    pub fn native(self, v: [f32; 3]) -> [f32; 3] {
        self.rows.map(|(k, negated)| if negated { -v[k] } else { v[k] })
    }

    /// The lookup vector of a native direction.
    pub fn lookup(self, native: [f32; 3]) -> [f32; 3] {
        let mut v = [0.0; 3];
        for ((k, negated), n) in self.rows.into_iter().zip(native) {
            v[k] = if negated { -n } else { n };
        }
        v
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::CubeFace;

    #[test]
    fn axes_are_those_of_the_frames() {
        for frame in Frame::ALL {
            let axes = CubeAxes::of(frame);
            for face in CubeFace::ALL {
                for (column, row) in [(0, 0), (3, 1), (2, 3)] {
                    let centre = |k: usize| (2 * k + 1) as f64 / 4.0 - 1.0;
                    let v = axes.native(face.lookup(centre(column), centre(row)).map(|x| x as f32));
                    let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
                    let expected = face.direction(frame, 4, column, row);
                    for (a, b) in v.into_iter().zip(expected) {
                        assert!((a / length - b).abs() < 1e-6, "{frame:?} {face:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn lookup_inverts() {
        for axes in [CubeAxes::GLTF, CubeAxes::FILAMENT, CubeAxes::BEVY, CubeAxes::THREE, CubeAxes::NATIVE] {
            let n = [0.1f32, -0.7, 0.4];
            assert_eq!(axes.native(axes.lookup(n)), n);
        }
        // what three.js negates: world (1, 0, 0) is found at −x
        assert_eq!(CubeAxes::THREE.lookup([1.0, 0.0, 0.0]), [-1.0, 0.0, 0.0]);
    }
}
