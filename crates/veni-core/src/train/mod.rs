//! Training: what defines a run ([`config`], [`presets`]), what one update does ([`batch`], [`step`], [`loss`],
//! [`schedule`], [`optimiser`]), and the loop with its folder ([`run`], [`checkpoint`], [`progress`]).

pub mod batch;
pub mod checkpoint;
pub mod config;
mod log;
pub mod loss;
pub mod optimiser;
pub mod presets;
mod preview;
pub mod progress;
pub mod run;
pub mod schedule;
pub mod step;
