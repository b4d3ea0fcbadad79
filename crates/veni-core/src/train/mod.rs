//! Training.

pub mod optimiser;
pub mod parameters;
