//! One command per file: its arguments, with their help, and what it does.

pub(crate) mod bake;
pub(crate) mod bench;
pub(crate) mod completions;
pub(crate) mod day;
pub(crate) mod encode;
#[cfg(feature = "learn")]
pub(crate) mod evaluate;
pub(crate) mod fit;
pub(crate) mod ibl;
pub(crate) mod inspect;
pub(crate) mod light;
pub(crate) mod man;
pub(crate) mod prepare;
pub(crate) mod render_probe;
pub(crate) mod sample;
pub(crate) mod synth;
#[cfg(feature = "learn")]
pub(crate) mod train;
