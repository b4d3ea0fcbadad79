//! One command per file: its arguments, with their help, and what it does.

pub(crate) mod bake;
pub(crate) mod bench;
pub(crate) mod completions;
#[cfg(feature = "learn")]
pub(crate) mod encode;
#[cfg(feature = "learn")]
pub(crate) mod evaluate;
#[cfg(feature = "learn")]
pub(crate) mod fit;
pub(crate) mod inspect;
pub(crate) mod man;
pub(crate) mod prepare;
pub(crate) mod render_probe;
pub(crate) mod sample;
pub(crate) mod synth;
#[cfg(feature = "learn")]
pub(crate) mod train;

use anyhow::Result;

use crate::args::Command;
use crate::report::{Outcome, Report};

/// Runs what was typed.
pub(crate) fn run(command: Command, report: Report) -> Result<Outcome> {
    match command {
        Command::Bake(c) => c.run(report),
        Command::Sample(c) => c.run(report),
        Command::Synth(c) => c.run(report),
        #[cfg(feature = "learn")]
        Command::Encode(c) => c.run(report),
        #[cfg(feature = "learn")]
        Command::Fit(c) => c.run(report),
        Command::Prepare(c) => c.run(report),
        Command::RenderProbe(c) => c.run(report),
        #[cfg(feature = "learn")]
        Command::Evaluate(c) => c.run(report),
        Command::Inspect(c) => c.run(report),
        Command::Bench(c) => c.run(report),
        #[cfg(feature = "learn")]
        Command::Train(c) => c.run(report),
        Command::Completions(c) => c.run(report),
        Command::Man(c) => c.run(report),
    }
}
