//! Whole-system tests: the real binary, in a fresh folder each time, on real panoramas.
#![cfg(feature = "learn")]

mod bad_input;
mod bake;
mod crashes;
mod encode;
mod evaluate;
mod fit;
#[cfg(feature = "gpu")]
mod gpu;
mod inspect;
mod prepare;
mod readers;
mod render_probe;
mod shards;
mod synth;
mod train_devices;
mod training;
mod util;
