//! Panoramas for training: loading, splitting, augmenting.
//!
//! An image here is natural-log radiance on an equirectangular grid (H × W × 3, row-major, channels last) at
//! exposure 0; what was subtracted is kept beside it.

pub mod augment;
pub mod coarsen;
mod dataset;
pub mod exposure;
mod fold;
mod holding;
mod pixels;
pub mod random;
mod splits;
mod store;

pub use augment::AugmentConfig;
pub use dataset::{Dataset, Heard, Item, panorama_files};
pub use fold::Fold;
pub use holding::Holding;
pub use pixels::Pixels;
pub use splits::{DataConfig, Splits};
