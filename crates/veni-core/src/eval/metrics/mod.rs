//! Metrics on plain slices; no tensors. Images are row-major with the channel last, as everywhere.

mod correlation;

pub use correlation::{pearson, ranks, spearman};
