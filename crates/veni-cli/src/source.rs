//! Where a model and a latent come from: whatever a user may name for them.

mod encoding;
mod image;
mod latent;
mod model;
mod radiance;
mod remembered;

pub(crate) use encoding::{Encoded, Encoding};
pub(crate) use image::{notes, panorama};
pub(crate) use latent::{RandomSkies, from_file, is_latent, model_of};
#[cfg(feature = "learn")]
pub(crate) use model::model_file;
pub(crate) use model::{Loaded, model};
pub(crate) use radiance::{Named, Radiance, radiance};
