//! Which direction each pixel of an image has.

use veni_light::sphere::{Equirect, Frame};

/// Which direction each pixel of an image has.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Directions {
    /// Latitude and longitude.
    Equirect(Equirect),
    /// Six square faces of `edge` pixels, one below the other, +X −X +Y −Y +Z −Z of the frame.
    Cube { edge: usize, frame: Frame },
}
