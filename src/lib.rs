//! Light a scene with a learned prior of natural outdoor light.
//!
//! This package re-exports [`veni_core`] and, with the feature `gpu`, `veni_gpu`.

#![forbid(unsafe_code)]

pub use veni_core::*;

#[cfg(feature = "gpu")]
pub use veni_gpu as gpu;
