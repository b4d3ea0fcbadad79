//! Trains a model: `cargo run --release -p veni-research --example train -- DATA OUT [small|tiny|paper] [key=value …]`,
//! or continues a run: `… --example train -- --resume OUT`.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use veni_core::progress::Observer;
use veni_core::train::presets::Preset;
use veni_core::train::progress::{Progress, StepReport, ValidationReport};
use veni_core::train::run::Trainer;
use veni_core::{Error, Result};

/// glibc returns every large block to the system and gets it back page by page: half of a step's time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

struct Print;

impl Observer for Print {
    fn begin(&self, unit: &'static str, task: &str, done: usize, total: usize) {
        println!("{task}: {unit} {done} of {total}");
    }

    fn advance(&self, _: usize) {}
}

impl Progress for Print {
    fn step(&self, report: &StepReport, remaining: f64) {
        if report.step.is_multiple_of(25) || report.step <= 5 {
            let parts: Vec<_> =
                report.parts.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
            let (step, loss, seconds) = (report.step, report.loss, report.seconds);
            println!(
                "{step} loss {loss:.4} ({}) {seconds:.3} s, {:.1} min left",
                parts.join(", "),
                remaining / 60.0
            );
        }
    }

    fn validation(&self, report: &ValidationReport) {
        println!("validation {}", serde_json::to_string(report).unwrap_or_default());
    }

    fn wrote(&self, path: &Path) {
        println!("wrote {}", path.display());
    }
}

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let command = std::env::args().skip(1).collect::<Vec<_>>().join(" ");
    let usage = || Error::invalid("usage: train DATA OUT [PRESET] [key=value …] | train --resume OUT");
    let mut trainer = match arguments.as_slice() {
        [flag, out] if flag == "--resume" => Trainer::resume(Path::new(out), &command)?,
        [data, out, rest @ ..] => {
            let (preset, overrides) = match rest {
                [first, tail @ ..] if !first.contains('=') => (first.parse()?, tail),
                all => (Preset::Small, all),
            };
            let mut config = preset.config(9).with_overrides(overrides)?;
            config.data.folders = vec![PathBuf::from(data)];
            Trainer::create(Path::new(out), config, &command)?
        }
        _ => return Err(usage()),
    };
    let finish = trainer.run(&AtomicBool::new(false), &Print)?;
    println!("{finish:?}");
    Ok(())
}
