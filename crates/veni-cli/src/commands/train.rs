//! `veni-cli train`: a model from a folder of panoramas.

mod args;
mod command_line;
mod config;
mod folder;
mod pixel_storage;
mod resume;

use std::time::Instant;

use anyhow::{Result, anyhow, bail};
use serde_json::json;
use veni_core::train::config::TrainConfig;
use veni_core::train::init::Initialised;
use veni_core::train::run::{Finish, Trainer};
use veni_light::Error;
use veni_light::model::ModelKind;

use crate::commands::inspect::run::{self, Best};
use crate::interrupt;
use crate::output::with_remedy;
use crate::progress::{ProgressBars, duration};
use crate::report::{Outcome, Report};
use args::TrainDevice;
use command_line::shell_word;

pub(crate) use args::Train;

impl Train {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        crate::allocator::keep_memory();
        let started = Instant::now();
        let mut trainer = if self.resume { self.continued(report)? } else { self.begun(report)? };
        note_device(trainer.config(), report)?;
        note_file(&trainer, report);
        if !trainer.is_locked() {
            let out = self.out.display();
            report
                .note(format_args!("{out}: this file system has no locks: let no other process train in it"));
        }
        if trainer.initialised() == Some(Initialised::Decoder) {
            let model = trainer.config().init.as_ref().map(|init| init.model.display().to_string());
            report.note(format_args!(
                "{}: only its decoder is taken; {}",
                model.unwrap_or_default(),
                match trainer.config().model.kind {
                    ModelKind::Veni => "it has no encoder, so that the run's starts from random weights",
                    ModelKind::Reni =>
                        "an auto-decoder has no encoder, and its latents start from random numbers",
                }
            ));
        }
        let stop =
            interrupt::handle("stopping after this step and writing a checkpoint (again: end at once)");
        let progress = ProgressBars::new(report);
        let finish = trainer.run(stop, &progress).map_err(with_remedy)?;
        progress.end();
        let (done, total) = (trainer.steps_done(), trainer.config().steps);
        let best = run::best(&self.out)?;
        self.report(report, finish, [done, total], best.as_ref(), started)?;
        if finish == Finish::Complete {
            return Ok(Outcome::Fine);
        }
        let out = shell_word(&self.out);
        report.note(format_args!(
            "stopped after step {done} of {total}; to go on: veni-cli train --resume --out {out}"
        ));
        Ok(Outcome::Negative)
    }

    /// A new run.
    fn begun(&self, report: Report) -> Result<Trainer> {
        let config = self.settings()?;
        let replaced = self.check_folder()?;
        let progress = ProgressBars::new(report);
        let trainer = Trainer::prepare(&self.out, config, &self.command_line(), &progress);
        progress.end();
        let mut trainer = trainer.map_err(|e| self.with_options(e))?;
        if replaced.is_some() {
            // what is there goes only now, when the new data is known to be good
            self.clear()?;
        }
        trainer.begin(replaced).map_err(with_remedy)?;
        Ok(trainer)
    }

    /// Adds to an error what the options of this command can do about it.
    fn with_options(&self, error: Error) -> anyhow::Error {
        match error {
            Error::Unsupported { .. } if self.device == Some(TrainDevice::Wgpu) && self.devices.is_some() => {
                anyhow!("{error}; 'veni-cli inspect --devices' lists the adapters")
            }
            // what the model differs in: the settings by the options that change them
            Error::Invalid { .. } if self.init.is_some() => anyhow!(
                error
                    .to_string()
                    .replace(": set model.latent_vectors=", ": --latent-vectors ")
                    .replace(": set model.", ": --set model.")
            ),
            error => with_remedy(error),
        }
    }

    /// A run that exists.
    fn continued(&self, report: Report) -> Result<Trainer> {
        let stored = self.out.join("config.toml");
        if !stored.is_file() {
            bail!(
                "{}: no run to continue (it has no config.toml); leave --resume out to begin one",
                self.out.display()
            );
        }
        self.check_same(&stored)?;
        let storage = self.pixel_storage(&stored)?;
        let progress = ProgressBars::new(report);
        let trainer = Trainer::resume_with(&self.out, &self.command_line(), &storage, &progress);
        progress.end();
        trainer.map_err(with_remedy)
    }

    fn report(
        &self,
        report: Report,
        finish: Finish,
        [done, total]: [u64; 2],
        best: Option<&Best>,
        started: Instant,
    ) -> Result<()> {
        let model = self.out.join("model.safetensors");
        let time = duration(started.elapsed());
        let valued = best.map_or_else(
            || "no validation yet".to_owned(),
            |b| format!("best validation LDR PSNR {:.2} dB at step {}", b.ldr_psnr, b.step),
        );
        let steps = if finish == Finish::Complete {
            format!("{total} steps")
        } else {
            format!("{done} of {total} steps")
        };
        let human = format!("{}: {steps} ({time}), {valued}", self.out.display());
        let value = json!({
            "run": self.out.display().to_string(),
            "finished": finish == Finish::Complete,
            "steps_done": done,
            "steps": total,
            "best": best.map(|b| json!({ "step": b.step, "ldr_psnr": b.ldr_psnr })),
            "model": model.is_file().then(|| model.display().to_string()),
            "seconds": started.elapsed().as_secs_f64(),
        });
        report.result(human, &value)
    }
}

/// How much of the data is not in memory, and how to change that.
fn note_file(trainer: &Trainer, report: Report) {
    let mib = trainer.mapped_bytes().div_ceil(1 << 20);
    if mib > 0 {
        let data = &trainer.config().data;
        let folder =
            data.scratch.as_ref().map_or("beside the run".to_owned(), |s| format!("in {}", s.display()));
        report.note(format_args!(
            "{mib} MiB of resampled panoramas are in a file without a name {folder}: a set may take data.memory_mib = {} in \
             memory, and data.scratch names the folder",
            data.memory_mib
        ));
    }
}

/// What the graphics devices are, and what about them will be slow.
fn note_device(config: &TrainConfig, report: Report) -> Result<()> {
    let kind = config.device;
    if kind.is_processor() {
        return Ok(());
    }
    for opened in kind.open_all(&config.devices)? {
        report.note(format_args!("training on {}", opened.name));
        if opened.software {
            report.note(format_args!("{} is a software adapter; --device flex is faster", opened.name));
        }
    }
    if config.decoder_backend.is_kernels() {
        report.note("decoder_backend = kernels: the decoder is computed by the processor, not on the device");
    }
    Ok(())
}
