//! Whole-system tests: the real binary, in a fresh folder each time, on real panoramas.
//!
//! Most need burn. What does not also runs alone: `cargo test -p veni-cli --no-default-features --test cli`.

#[cfg(feature = "pretrained")]
mod asked;
mod avif;
#[cfg(feature = "learn")]
mod bad_input;
#[cfg(feature = "learn")]
mod bake;
#[cfg(feature = "pretrained")]
mod cases;
#[cfg(feature = "pretrained")]
mod codes;
#[cfg(feature = "learn")]
mod crashes;
#[cfg(feature = "pretrained")]
mod dark_end;
#[cfg(feature = "pretrained")]
mod embedded;
#[cfg(feature = "learn")]
mod encode;
mod entries;
#[cfg(feature = "learn")]
mod evaluate;
mod expand_with;
#[cfg(feature = "learn")]
mod fit;
#[cfg(feature = "pretrained")]
mod fit_light;
#[cfg(feature = "learn")]
mod folds;
#[cfg(all(feature = "learn", feature = "gpu"))]
mod gpu;
mod ibl;
#[cfg(feature = "learn")]
mod inspect;
#[cfg(feature = "pretrained")]
mod known;
#[cfg(feature = "learn")]
mod large_sets;
#[cfg(feature = "pretrained")]
mod light;
mod limits;
#[cfg(feature = "pretrained")]
mod named;
#[cfg(feature = "onnx")]
#[path = "../../crates/veni-data/src/expand/network/onnx_file.rs"]
#[allow(dead_code, reason = "veni-data's tests use the rest of it")]
mod onnx_file;
mod outside;
#[cfg(feature = "pretrained")]
mod pictures;
#[cfg(feature = "pretrained")]
mod pipes;
#[cfg(feature = "learn")]
mod prepare;
#[cfg(feature = "pretrained")]
mod promises;
#[cfg_attr(not(feature = "learn"), allow(dead_code, reason = "few tests run without burn"))]
mod readers;
#[cfg(feature = "pretrained-large")]
mod remembered;
#[cfg(feature = "learn")]
mod render_probe;
#[cfg(feature = "learn")]
mod runs;
#[cfg(feature = "learn")]
mod shards;
#[cfg(feature = "learn")]
mod synth;
#[cfg(all(unix, feature = "pretrained"))]
mod terminal;
#[cfg(feature = "learn")]
mod train_devices;
#[cfg(feature = "learn")]
mod training;
#[cfg_attr(not(feature = "learn"), allow(dead_code, reason = "few tests run without burn"))]
mod util;
#[cfg(feature = "pretrained")]
mod writers;
