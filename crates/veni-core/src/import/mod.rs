//! Weights of other programs.

mod checkpoint;

pub use checkpoint::Checkpoint;
