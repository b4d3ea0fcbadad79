//! Which direction each pixel of an image has.

use veni_light::sphere::{CubeFace, Equirect, Frame};

/// Which direction each pixel of an image has.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Directions {
    /// Latitude and longitude.
    Equirect(Equirect),
    /// Six square faces of `edge` pixels, one below the other, +X −X +Y −Y +Z −Z of the frame.
    Cube { edge: usize, frame: Frame },
}

impl Directions {
    /// The direction of one pixel.
    pub(crate) fn at(self, column: usize, row: usize) -> [f32; 3] {
        match self {
            Self::Equirect(grid) => grid.direction(column, row),
            Self::Cube { edge, frame } => {
                CubeFace::ALL[row / edge].direction(frame, edge, column, row % edge)
            }
        }
    }
}
