//! Training: what defines a run ([`config`], [`presets`], [`init`]), what one update does ([`batch`], [`step`], [`loss`],
//! [`replicas`], [`schedule`], [`optimiser`]; of an auto-decoder [`rays`] and [`latents`]), and the loop with its folder
//! ([`run`], [`checkpoint`], [`progress`]).

pub mod batch;
pub mod checkpoint;
pub mod config;
#[cfg(test)]
mod device_tests;
mod draws;
pub mod init;
pub mod latents;
mod log;
pub mod loss;
mod native;
pub mod network;
pub mod optimiser;
pub mod presets;
mod preview;
pub mod progress;
pub mod rays;
pub mod replicas;
pub mod run;
pub mod step;

pub use veni_fit::schedule;
