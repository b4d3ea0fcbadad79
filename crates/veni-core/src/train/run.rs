//! The training loop and its folder.
//!
//! | file | content |
//! |---|---|
//! | `config.toml` | the [`TrainConfig`], everything that defines the run; written last of what a run begins with |
//! | `metrics.jsonl` | a line per update and per validation |
//! | `checkpoint/state.safetensors` | weights, Adam's moments, averaged weights, step |
//! | `preview/step-*.png` | target, reconstruction, random sample |
//! | `command.txt` | the command that began the run |
//! | `.lock` | locked by the process that trains |
//! | `model.safetensors` | the averaged weights that validated best, with the prior of the training latents |
//! | `latents.safetensors` | of an auto-decoder: the latent table of these weights (see [`latents::save`](crate::train::latents::save)) |
//!
//! A run is a function of its configuration: batches and noise are named by their step, so continuing from a
//! checkpoint gives the weights of the uninterrupted run to the bit (on one device and number of threads).

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use burn::module::Module;
use serde::Serialize;

use crate::train::checkpoint::{self, BestValidation, CheckpointInfo};
use crate::train::config::{Stage, TrainConfig};
use crate::train::init::Initialised;
use crate::train::log::MetricsLog;
use crate::train::network::{Network, Prepared};
use crate::train::optimiser::{Group, Optimiser};
use crate::train::progress::{Progress, StepReport, ValidationReport};
use crate::train::replicas::{Computed, Replicas};
use crate::vae::weights;
use crate::{Error, Result};
use veni_data::{Dataset, Splits};
use veni_light::output::Lock;

mod begin;
mod folder;
mod results;

pub use folder::{is_free, leftovers, lock};

/// Batches prepared ahead of the one being computed.
const AHEAD: usize = 2;

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
    /// Nobody else trains in the folder.
    lock: Option<Lock>,
    config: TrainConfig,
    /// Of the run's own `data`.
    splits: Splits,
    stages: Vec<Running>,
    /// The command line recorded in the model file.
    command: String,
    replicas: Replicas,
    optimiser: Optimiser,
    best: Option<BestValidation>,
    initialised: Option<Initialised>,
}

/// A stage with what it needs.
#[derive(Clone, Debug)]
struct Running {
    stage: Stage,
    /// Its own training panoramas; absent if they are the run's, or not needed any more.
    data: Option<Dataset>,
}

impl Trainer {
    /// What defines this run.
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Bytes of panoramas that are in files, not in memory ([`DataConfig::memory_mib`](veni_data::DataConfig::memory_mib)).
    pub fn mapped_bytes(&self) -> u64 {
        let own = [&self.splits.train, &self.splits.val];
        let stages = self.stages.iter().filter_map(|running| running.data.as_ref());
        own.into_iter().chain(stages).map(Dataset::mapped_bytes).sum()
    }

    /// Updates made so far.
    pub fn steps_done(&self) -> u64 {
        self.optimiser.updates()
    }

    /// The network with its current (not averaged) weights.
    pub fn network(&self) -> &Network {
        self.replicas.first()
    }

    /// Whether nobody else can train in the run's folder: not where a file system knows no locks.
    pub fn is_locked(&self) -> bool {
        self.lock.as_ref().is_some_and(Lock::is_held)
    }

    /// What a run that was just created has from `config.init`.
    pub fn initialised(&self) -> Option<Initialised> {
        self.initialised
    }

    /// Trains until all updates are made or `stop` is raised, which is looked at before every update and between the
    /// panoramas of a validation.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the loss is no longer finite; [`Error::Io`] if a file of the run cannot be written.
    pub fn run(&mut self, stop: &AtomicBool, progress: &dyn Progress) -> Result<Finish> {
        let total = self.config.steps;
        let mut log = MetricsLog::open(&self.folder.join("metrics.jsonl"), self.steps_done(), total)?;
        progress.begin("step", "training", self.steps_done() as usize, total as usize);
        if self.catch_up(stop, &mut log, progress)? == Finish::Stopped {
            return Ok(Finish::Stopped);
        }
        for at in 0..self.stages.len() {
            if self.stages[at].stage.end() > self.steps_done()
                && self.stage(at, stop, progress, &mut log)? == Finish::Stopped
            {
                return Ok(Finish::Stopped);
            }
            // a stage's panoramas go with it
            self.stages[at].data = None;
        }
        // the checkpoint of the last update is written: what is stopped here is done again
        stopped_or(self.finish(stop, &mut log, progress))
    }

    /// The validation and the preview of the update that was made last, if the run was stopped in the midst of them.
    fn catch_up(
        &mut self,
        stop: &AtomicBool,
        log: &mut MetricsLog,
        progress: &dyn Progress,
    ) -> Result<Finish> {
        let step = self.steps_done();
        if step == 0 || step == self.config.steps {
            return Ok(Finish::Complete);
        }
        let mut done = Ok(());
        if self.validates(step) && !log.is_validated() {
            done = self.validate(stop, log, progress);
        }
        if done.is_ok() && due(step, self.config.report.preview_every) && !self.preview_path().exists() {
            done = self.preview(stop, progress);
        }
        stopped_or(done)
    }

    /// Whether the run is validated after update `step`.
    fn validates(&self, step: u64) -> bool {
        due(step, self.config.report.validate_every)
            || self.stages.iter().any(|running| running.stage.end() == step)
    }

    fn stage(
        &mut self,
        at: usize,
        stop: &AtomicBool,
        progress: &dyn Progress,
        log: &mut MetricsLog,
    ) -> Result<Finish> {
        let Running { stage, data } = self.stages[at].clone();
        self.optimiser.set_groups(groups(&stage.config));
        self.replicas.set_losses(&stage.config);
        let train = data.unwrap_or_else(|| self.splits.train.clone());
        let batches = self.network().source(&stage.config, &train)?;
        let steps = self.steps_done() - stage.first + 1..=stage.config.steps;
        std::thread::scope(|scope| {
            let (send, receive) = mpsc::sync_channel(AHEAD);
            // ends early when nobody receives any more
            scope.spawn(move || steps.into_iter().all(|step| send.send(batches.prepare(step)).is_ok()));
            // `receive` is moved in, so that whatever ends the loop also ends the thread
            self.updates(&stage, receive, stop, progress, log)
        })
    }

    fn updates(
        &mut self,
        stage: &Stage,
        batches: mpsc::Receiver<Prepared>,
        stop: &AtomicBool,
        progress: &dyn Progress,
        log: &mut MetricsLog,
    ) -> Result<Finish> {
        let total = self.config.steps;
        let mut pace = None;
        let report = self.config.report;
        for batch in batches {
            if stop.load(Ordering::Relaxed) {
                self.checkpoint(log, progress)?;
                return Ok(Finish::Stopped);
            }
            let update = self.update(stage, batch)?;
            // a running mean: steady against single slow updates, quick to follow a changed machine
            let mean = pace.map_or(update.seconds, |p: f64| p + 0.05 * (update.seconds - p));
            pace = Some(mean);
            let step = update.step;
            log.append(&update)?;
            progress.step(&update, mean * (total - step) as f64);
            progress.advance(1);
            let mut looked = Ok(());
            if self.validates(step) && step != total {
                looked = self.validate(stop, log, progress);
            }
            if looked.is_ok() && due(step, report.preview_every) && step != total {
                looked = self.preview(stop, progress);
            }
            if stopped_or(looked)? == Finish::Stopped {
                self.checkpoint(log, progress)?;
                return Ok(Finish::Stopped);
            }
            if due(step, report.checkpoint_every) || step == stage.end() {
                self.checkpoint(log, progress)?;
            }
        }
        Ok(Finish::Complete)
    }

    /// One update.
    fn update(&mut self, stage: &Stage, batch: Prepared) -> Result<StepReport> {
        let clock = Instant::now();
        let (local, images) = (batch.step(), batch.images());
        let step = stage.first + local;
        let Computed { value, parts, gradients } = self.replicas.gradients(batch, stage.config.accumulate);
        if !value.is_finite() {
            return Err(Error::invalid(format!(
                "the loss is {value} at update {step}: lower the learning rates or the clipping norm"
            )));
        }
        // schedules count from 0: with a warm-up the first update has rate 0, as the reference's has
        let configured = stage.config.groups();
        let rates: Vec<_> = configured.iter().map(|(_, group)| group.learning_rate.at(local - 1)).collect();
        let groups = self.optimiser.update(&gradients, &rates);
        self.replicas.write(self.optimiser.weights())?;
        let seconds = clock.elapsed().as_secs_f64();
        let by_name = |f: &dyn Fn(usize) -> f64| {
            configured.iter().enumerate().map(|(i, (name, _))| (*name, f(i))).collect()
        };
        Ok(StepReport {
            step,
            stage: stage.name.clone(),
            loss: value,
            parts,
            learning_rate: by_name(&|i| groups[i].learning_rate),
            gradient_norm: by_name(&|i| groups[i].gradient_norm),
            seconds,
            images_per_second: images as f64 / seconds,
        })
    }

    fn checkpoint(&self, log: &MetricsLog, progress: &dyn Progress) -> Result<()> {
        // a state that is on disk must find its lines there too
        log.sync()?;
        let path = self.checkpoint_path();
        checkpoint::save(&path, &self.optimiser.state(), &CheckpointInfo::new(self.steps_done(), self.best))?;
        progress.wrote(&path);
        Ok(())
    }

    fn checkpoint_path(&self) -> PathBuf {
        checkpoint_path(&self.folder)
    }

    /// The preview after the last update.
    fn preview_path(&self) -> PathBuf {
        self.folder.join("preview").join(format!("step-{:06}.png", self.steps_done()))
    }
}

/// Whether something is done every `every` updates is due after this one; never if `every` is 0.
fn due(step: u64, every: u64) -> bool {
    every > 0 && step.is_multiple_of(every)
}

/// A cancelled piece of work is a run that was stopped.
fn stopped_or(done: Result<()>) -> Result<Finish> {
    match done {
        Ok(()) => Ok(Finish::Complete),
        Err(Error::Cancelled) => Ok(Finish::Stopped),
        Err(error) => Err(error),
    }
}

fn checkpoint_path(folder: &Path) -> PathBuf {
    folder.join("checkpoint").join("state.safetensors")
}

/// The optimiser's groups.
fn groups(config: &TrainConfig) -> Vec<Group> {
    let group = |(prefix, group): (&str, &crate::train::config::GroupConfig)| Group {
        prefix: prefix.into(),
        adam: group.adam,
    };
    config.groups().into_iter().map(group).collect()
}

#[derive(Serialize)]
struct Record<'a> {
    step: u64,
    validation: &'a ValidationReport,
}

#[cfg(test)]
mod tests;
