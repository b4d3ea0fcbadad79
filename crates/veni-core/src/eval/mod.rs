//! Metrics and evaluation protocols.

pub mod lpips;
pub mod metrics;
pub mod reconstruction;
