//! The training loop and its folder.
//!
//! | file | content |
//! |---|---|
//! | `config.toml` | the [`TrainConfig`], everything that defines the run |
//! | `metrics.jsonl` | a line per update and per validation |
//! | `checkpoint/state.safetensors` | weights, Adam's moments, averaged weights, step |
//! | `preview/step-*.png` | target, reconstruction, random sample |
//! | `model.safetensors` | the averaged weights that validated best, with the prior of the training latents |
//! | `latents.safetensors` | of an auto-decoder: the latent table of these weights (see [`latents::save`](crate::train::latents::save)) |
//!
//! A run is a function of its configuration: batches and noise are named by their step, so continuing from a
//! checkpoint gives the weights of the uninterrupted run to the bit (on one device and number of threads).

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use burn::module::Module;
use burn::tensor::Device;
use serde::Serialize;

use crate::data::random::{Purpose, stream};
use crate::data::{Dataset, Generated, Splits};
use crate::eval::metrics::Alignment;
use crate::eval::reconstruction::Reconstruction;
use crate::latent::{Latent, Prior};
use crate::model::{Model, ModelInfo, Training};
use crate::output::{Overwrite, write_atomic};
use crate::train::checkpoint::{self, Best, CheckpointInfo};
use crate::train::config::TrainConfig;
use crate::train::log::MetricsLog;
use crate::train::loss::Loss;
use crate::train::network::{Network, Prepared};
use crate::train::optimiser::{Group, Optimiser};
use crate::train::preview;
use crate::train::progress::{Progress, StepReport, ValidationReport};
use crate::vae::{Decoder, weights};
use crate::{Error, Result};

mod results;

/// Batches prepared ahead of the one being computed.
const AHEAD: usize = 2;
/// Panoramas in a preview.
const PREVIEW_ROWS: usize = 8;

/// How [`Trainer::run`] came back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finish {
    /// All updates are made and `model.safetensors` is final.
    Complete,
    /// The stop flag was raised; a checkpoint was written.
    Stopped,
}

/// A run: its folder, its data and its state.
#[derive(Debug)]
pub struct Trainer {
    folder: PathBuf,
    config: TrainConfig,
    splits: Splits,
    /// The command line recorded in the model file.
    command: String,
    device: Device,
    loss: Loss,
    network: Network,
    optimiser: Optimiser,
    best: Option<Best>,
}

impl Trainer {
    /// Starts a run in `folder`, which must not exist or be empty. `command` is recorded in the model file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the folder is in use or the configuration does not fit; what reading the data says.
    pub fn create(folder: &Path, config: TrainConfig, command: &str) -> Result<Self> {
        Self::create_with(folder, config, command, &|_, _| {})
    }

    /// As [`Trainer::create`]; `progress` is told how many of the generated scenes are there.
    ///
    /// # Errors
    /// As [`Trainer::create`].
    pub fn create_with(
        folder: &Path,
        config: TrainConfig,
        command: &str,
        progress: &Generated<'_>,
    ) -> Result<Self> {
        config.check()?;
        let splits = Splits::open_with(&config.data, config.seed, progress)?;
        if folder.exists() && fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?.next().is_some()
        {
            let folder = folder.display();
            return Err(Error::invalid(format!(
                "{folder}: is not empty; --resume continues a run, or name a new folder"
            )));
        }
        for inner in ["checkpoint", "preview"] {
            let inner = folder.join(inner);
            fs::create_dir_all(&inner).map_err(|e| Error::io(&inner, "create", e))?;
        }
        let text = config.to_toml()?;
        let path = folder.join("config.toml");
        write_atomic(&path, Overwrite::Replace, |out| {
            std::io::Write::write_all(out, text.as_bytes()).map_err(|e| Error::io(&path, "write", e))
        })?;
        Self::fresh(folder, config, splits, command)
    }

    /// Continues the run in `folder` from its checkpoint (or from the start, if it was ended before its first).
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Invalid`] if `config.toml` or the checkpoint cannot be read or do not fit together.
    pub fn resume(folder: &Path, command: &str) -> Result<Self> {
        Self::resume_with(folder, command, &|_, _| {})
    }

    /// As [`Trainer::resume`]; `progress` is told how many of the generated scenes are there.
    ///
    /// # Errors
    /// As [`Trainer::resume`].
    pub fn resume_with(folder: &Path, command: &str, progress: &Generated<'_>) -> Result<Self> {
        let path = folder.join("config.toml");
        let text = fs::read_to_string(&path).map_err(|e| Error::io(&path, "read", e))?;
        let config = TrainConfig::from_toml(&text).map_err(|e| e.in_file(&path))?;
        let splits = Splits::open_with(&config.data, config.seed, progress)?;
        let mut trainer = Self::fresh(folder, config, splits, command)?;
        let path = trainer.checkpoint_path();
        if path.exists() {
            let (state, info) = checkpoint::load(&path)?;
            trainer.optimiser.restore(state, info.step).map_err(|e| e.in_file(&path))?;
            trainer.network = weights::write(trainer.network, "", &trainer.optimiser.weights())?;
            trainer.best = info.best;
        }
        Ok(trainer)
    }

    fn fresh(folder: &Path, config: TrainConfig, splits: Splits, command: &str) -> Result<Self> {
        let device = config.device.device()?.autodiff();
        let network = Network::new(&config, splits.train.len(), &device)?;
        let groups = config.groups().into_iter();
        let groups =
            groups.map(|(prefix, group)| Group { prefix: prefix.into(), adam: group.adam }).collect();
        let optimiser = Optimiser::new(&network, groups, config.ema_decay)?;
        let loss = Network::loss(&config, &device);
        let (folder, command) = (folder.to_path_buf(), command.to_owned());
        Ok(Self { folder, config, splits, command, device, loss, network, optimiser, best: None })
    }

    /// What defines this run.
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Updates made so far.
    pub fn steps_done(&self) -> u64 {
        self.optimiser.updates()
    }

    /// The network with its current (not averaged) weights.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Trains until all updates are made or `stop` is raised, which is looked at before every update.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the loss is no longer finite; [`Error::Io`] if a file of the run cannot be written.
    pub fn run(&mut self, stop: &AtomicBool, progress: &mut dyn Progress) -> Result<Finish> {
        let mut log = MetricsLog::open(&self.folder.join("metrics.jsonl"), self.steps_done())?;
        let (first, total) = (self.steps_done() + 1, self.config.steps);
        progress.start(first - 1, total);
        let splits = self.splits.clone();
        let batches = self.network.source(&self.config, &splits.train)?;
        let finish = std::thread::scope(|scope| {
            let (send, receive) = mpsc::sync_channel(AHEAD);
            // ends early when nobody receives any more
            scope.spawn(move || (first..=total).all(|step| send.send(batches.prepare(step)).is_ok()));
            // `receive` is moved in, so that whatever ends the loop also ends the thread
            self.updates(receive, stop, progress, &mut log)
        })?;
        if finish == Finish::Complete {
            self.finish(&mut log, progress)?;
        }
        Ok(finish)
    }

    fn updates(
        &mut self,
        batches: mpsc::Receiver<Prepared>,
        stop: &AtomicBool,
        progress: &mut dyn Progress,
        log: &mut MetricsLog,
    ) -> Result<Finish> {
        let total = self.config.steps;
        let mut pace = None;
        let report = self.config.report;
        let due = |step: u64, every: u64| every > 0 && step.is_multiple_of(every);
        for batch in batches {
            if stop.load(Ordering::Relaxed) {
                self.checkpoint(progress)?;
                return Ok(Finish::Stopped);
            }
            let update = self.update(&batch)?;
            // a running mean: steady against single slow updates, quick to follow a changed machine
            let mean = pace.map_or(update.seconds, |p: f64| p + 0.05 * (update.seconds - p));
            pace = Some(mean);
            let step = update.step;
            log.append(&update)?;
            progress.step(&update, mean * (total - step) as f64);
            if due(step, report.validate_every) && step != total {
                self.validate(log, progress)?;
            }
            if due(step, report.preview_every) && step != total {
                self.preview(progress)?;
            }
            if due(step, report.checkpoint_every) || step == total {
                self.checkpoint(progress)?;
            }
        }
        Ok(Finish::Complete)
    }

    /// One update.
    fn update(&mut self, batch: &Prepared) -> Result<StepReport> {
        let clock = Instant::now();
        let step = batch.step();
        let terms = self.network.terms(batch, &self.loss, &self.device);
        let total = terms.total();
        let value = f64::from(total.clone().into_scalar::<f32>());
        if !value.is_finite() {
            return Err(Error::invalid(format!(
                "the loss is {value} at update {step}: lower the learning rates or the clipping norm"
            )));
        }
        let gradients = total.backward();
        // schedules count from 0: with a warm-up the first update has rate 0, as the authors' has
        let configured = self.config.groups();
        let rates: Vec<_> = configured.iter().map(|(_, group)| group.learning_rate.at(step - 1)).collect();
        let (network, groups) = self.optimiser.step(self.network.clone(), &gradients, &rates);
        self.network = network;
        let seconds = clock.elapsed().as_secs_f64();
        let by_name = |f: &dyn Fn(usize) -> f64| {
            configured.iter().enumerate().map(|(i, (name, _))| (*name, f(i))).collect()
        };
        Ok(StepReport {
            step,
            loss: value,
            parts: terms
                .terms
                .into_iter()
                .map(|t| (t.name, f64::from(t.value.into_scalar::<f32>())))
                .collect(),
            learning_rate: by_name(&|i| groups[i].learning_rate),
            gradient_norm: by_name(&|i| groups[i].gradient_norm),
            seconds,
            images_per_second: batch.images() as f64 / seconds,
        })
    }

    fn checkpoint(&self, progress: &mut dyn Progress) -> Result<()> {
        let path = self.checkpoint_path();
        checkpoint::save(&path, &self.optimiser.state(), &CheckpointInfo::new(self.steps_done(), self.best))?;
        progress.wrote(&path);
        Ok(())
    }

    fn checkpoint_path(&self) -> PathBuf {
        self.folder.join("checkpoint").join("state.safetensors")
    }
}

#[derive(Serialize)]
struct Record<'a> {
    step: u64,
    validation: &'a ValidationReport,
}

#[cfg(test)]
#[path = "run_tests.rs"]
mod tests;
