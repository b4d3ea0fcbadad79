//! How other software names the directions of the same panorama. Pixels never change, only coordinates.

/// A coordinate frame for directions, all right-handed. What each calls the six landmarks of a panorama:
///
/// | landmark of the image | `Blender` (native) | `Gltf` | `OpenExr` | `Bevy` |
/// |---|---|---|---|---|
/// | centre | +x | +x | +z | −z |
/// | left quarter (column W/4) | +y | −z | +x | −x |
/// | right quarter (column 3W/4) | −y | +z | −x | +x |
/// | seam (left and right edge) | −x | −x | −z | +z |
/// | top | +z | +y | +y | +y |
/// | bottom | −z | −y | −y | −y |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Frame {
    /// z up, the image centre at +x: the native frame, and Blender's for an environment texture without rotation.
    #[default]
    Blender,
    /// y up, the image centre at +x: Blender's world after glTF's change of axes, and three.js'
    /// equirectangular mapping.
    Gltf,
    /// y up, the image centre at +z, longitude growing to the left: OpenEXR's `latlong` environment maps and
    /// USD's dome light.
    OpenExr,
    /// y up, the image centre at −z, where a Bevy camera without rotation looks. Bevy shows environments as cube
    /// maps, and its shaders negate z before looking one up: [`CubeFace::direction`](super::CubeFace::direction)
    /// does the same for this frame.
    Bevy,
}

impl Frame {
    /// All frames.
    pub const ALL: [Self; 4] = [Self::Blender, Self::Gltf, Self::OpenExr, Self::Bevy];

    /// A direction of this frame in the native frame.
    #[inline]
    pub fn to_native(self, direction: [f32; 3]) -> [f32; 3] {
        self.permuted(direction)
    }

    /// [`Frame::to_native`] in any precision.
    #[inline]
    pub(super) fn permuted<T: std::ops::Neg<Output = T>>(self, [x, y, z]: [T; 3]) -> [T; 3] {
        match self {
            Self::Blender => [x, y, z],
            Self::Gltf => [x, -z, y],
            Self::OpenExr => [z, x, y],
            Self::Bevy => [-z, -x, y],
        }
    }

    /// A native direction in this frame.
    #[inline]
    pub fn from_native(self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Blender => [x, y, z],
            Self::Gltf => [x, z, -y],
            Self::OpenExr => [y, z, x],
            Self::Bevy => [-y, z, -x],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::Equirect;

    /// What the table in the documentation says, in its order of landmarks.
    fn labels(frame: Frame) -> [[f32; 3]; 6] {
        let [x, y, z] = [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        let minus = |[a, b, c]: [f32; 3]| [-a, -b, -c];
        match frame {
            Frame::Blender => [x, y, minus(y), minus(x), z, minus(z)],
            Frame::Gltf => [x, minus(z), z, minus(x), y, minus(y)],
            Frame::OpenExr => [z, x, minus(x), minus(z), y, minus(y)],
            Frame::Bevy => [minus(z), minus(x), x, z, y, minus(y)],
        }
    }

    #[test]
    fn six_labelled_directions() {
        let (w, h) = (8000usize, 4000usize);
        let grid = Equirect::new(w, h);
        // centre, left quarter, right quarter, seam, top, bottom: the nearest pixel centres
        let landmarks =
            [(w / 2, h / 2), (w / 4, h / 2), (3 * w / 4, h / 2), (0, h / 2), (w / 2, 0), (w / 2, h - 1)];
        for frame in Frame::ALL {
            for ((column, row), expected) in landmarks.into_iter().zip(labels(frame)) {
                let found = frame.from_native(grid.direction(column, row));
                let miss = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
                assert!(miss < 1e-3, "{frame:?}, pixel ({column}, {row}): {found:?} is not {expected:?}");
            }
        }
    }

    #[test]
    fn frames_are_rotations_and_invert() {
        for frame in Frame::ALL {
            let columns = [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(|axis| frame.from_native(axis));
            let [a, b, c] = columns;
            let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            assert_eq!(cross.map(|v| v + 0.0), c.map(|v| v + 0.0), "{frame:?} is not right-handed");
            let d = [0.3, -0.5, 0.8];
            assert_eq!(frame.to_native(frame.from_native(d)), d);
        }
    }
}
