//! Metrics and evaluation protocols.

pub mod metrics;
pub mod reconstruction;
