//! Cube maps as engines load them: KTX2, KTX1, Babylon's `.env`. Files as bytes: the same for the same texels, every time.
//!
//! The layout of each is in the head of its file. Values that a format cannot hold are refused with
//! [`Error`](crate::Error), never cut off.

mod env;
mod ktx1;
mod ktx2;
mod rgbd;
mod texel;

#[cfg(test)]
mod tests;

pub use env::{EnvHeader, EnvImage, EnvSpecular, env};
pub use ktx1::ktx1;
pub use ktx2::{Ktx2Header, ktx2};
#[cfg(test)]
pub(crate) use rgbd::from_rgbd;
pub use rgbd::{rgbd, rgbd_png};
pub use texel::TexelFormat;
#[cfg(test)]
pub(crate) use texel::{decode_e5b9g9r9, decode_r11g11b10};
