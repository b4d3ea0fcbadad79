//! Training.

pub mod batch;
pub mod checkpoint;
pub mod config;
pub mod log;
pub mod loss;
pub mod optimiser;
pub mod presets;
pub mod preview;
pub mod progress;
pub mod run;
pub mod schedule;
pub mod standin;
pub mod step;
