//! Directions and grids on the sphere. No tensors here.
//!
//! # Conventions (the same everywhere in veni)
//! - The native frame is right-handed with **z up**; the group SO(2) acts on x and y. The azimuth φ runs
//!   counter-clockwise seen from above (from +x to +y), the polar angle θ is measured from +z.
//! - An equirectangular image has row 0 on top (+z). Pixel centres: θ = π(j+½)/H, φ = π − 2π(i+½)/W. The
//!   centre of the image looks along +x, image right is −y (as in Blender; after the usual change from z up
//!   to y up also as in glTF).
//! - Angles are radians unless a name says degrees. Directions are unit `[f32; 3]`, colours linear `[f32; 3]`.
//!
//! | here | what |
//! |---|---|
//! | [`Equirect`] | the pixel grid of a panorama, solid angles |
//! | [`Frame`] | directions of Blender, glTF, OpenEXR/USD, Bevy |
//! | [`CubeFace`] | cube maps: texel directions and solid angles |
//! | [`Stripes`], [`Gather`] | where the encoder looks, and fast lookup there |
//! | [`ways`] | a few directions that stand for all |
//! | [`mod@reference`] | the samplers of the reference implementation, for their weights and numbers |

mod cube;
mod equirect;
mod frame;
mod gather;
pub mod reference;
mod stripes;
mod view;
mod ways;

pub use cube::CubeFace;
pub use equirect::Equirect;
pub use frame::Frame;
pub use gather::Gather;
pub use stripes::{StripeSampling, Stripes};
pub use view::View;
pub use ways::ways;
