//! Training.

pub mod batch;
pub mod checkpoint;
pub mod config;
pub mod log;
pub mod optimiser;
pub mod presets;
pub mod preview;
pub mod progress;
pub mod run;
pub mod standin;
pub mod step;
