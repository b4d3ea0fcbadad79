//! Panoramas for training: preparing, expanding, loading, splitting, augmenting.
//!
//! An image here is natural-log radiance on an equirectangular grid (H × W × 3, row-major, channels last) at
//! exposure 0; what was subtracted is kept beside it.

pub mod augment;
pub mod coarsen;
mod dataset;
pub mod expand;
mod fold;
mod generated;
pub mod limits;
mod listing;
pub mod parallel;
mod part;
mod pixel_storage;
mod pixels;
pub mod prepare;
mod reconstruction;
mod splits;
mod store;
mod whole;

pub use veni_light::{Error, Result};

pub use augment::AugmentConfig;
pub use dataset::{Dataset, Item};
pub use fold::Fold;
pub use listing::panorama_files;
pub use part::Part;
pub use pixel_storage::PixelStorage;
pub use pixels::Pixels;
pub use reconstruction::Reconstruction;
pub use splits::{DataConfig, Splits};
