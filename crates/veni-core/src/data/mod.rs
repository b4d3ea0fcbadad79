//! Panoramas for training: loading, splitting, augmenting.
//!
//! An image here is natural-log radiance on an equirectangular grid (H × W × 3, row-major, channels last) at
//! exposure 0; what was subtracted is kept beside it.

pub mod augment;
pub mod coarsen;
mod dataset;
pub mod exposure;
pub mod random;

pub use augment::AugmentConfig;
pub use dataset::{DataConfig, Dataset, Generated, Item, Splits, panorama_files};
