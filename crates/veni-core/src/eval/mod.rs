//! Evaluation: metrics between panoramas.

pub mod metrics;
