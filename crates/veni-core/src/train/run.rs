//! The training loop and its folder.
//!
//! | file | content |
//! |---|---|
//! | `config.toml` | the [`TrainConfig`], everything that defines the run |
//! | `metrics.jsonl` | a line per update and per validation |
//! | `checkpoint/state.safetensors` | weights, Adam's moments, averaged weights, step |
//! | `preview/step-*.png` | target, reconstruction, random sample |
//! | `model.safetensors` | the averaged weights that validated best, with the prior of the training latents |
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
use crate::data::{Dataset, Splits};
use crate::eval::metrics::Alignment;
use crate::eval::reconstruction::Reconstruction;
use crate::latent::{Latent, Prior};
use crate::model::{Model, ModelInfo, Training};
use crate::output::{Overwrite, write_atomic};
use crate::train::batch::{Batch, Batches};
use crate::train::checkpoint::{self, Best, CheckpointInfo};
use crate::train::config::TrainConfig;
use crate::train::log::MetricsLog;
use crate::train::loss::Loss;
use crate::train::optimiser::{Group, Optimiser};
use crate::train::preview;
use crate::train::progress::{Progress, StepReport, ValidationReport};
use crate::train::step::batch_loss;
use crate::vae::{Veni, weights};
use crate::{Error, Result};

/// Batches prepared ahead of the one being computed.
const AHEAD: usize = 2;
/// Parameter groups, in the order of their learning rates.
const GROUPS: [&str; 2] = ["decoder", "encoder"];
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
    veni: Veni,
    optimiser: Optimiser,
    best: Option<Best>,
}

impl Trainer {
    /// Starts a run in `folder`, which must not exist or be empty. `command` is recorded in the model file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the folder is in use or the configuration does not fit; what reading the data says.
    pub fn create(folder: &Path, config: TrainConfig, command: &str) -> Result<Self> {
        config.check()?;
        let splits = Splits::open(&config.data, config.seed)?;
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
        let path = folder.join("config.toml");
        let text = fs::read_to_string(&path).map_err(|e| Error::io(&path, "read", e))?;
        let config = TrainConfig::from_toml(&text).map_err(|e| e.in_file(&path))?;
        let splits = Splits::open(&config.data, config.seed)?;
        let mut trainer = Self::fresh(folder, config, splits, command)?;
        let path = trainer.checkpoint_path();
        if path.exists() {
            let (state, info) = checkpoint::load(&path)?;
            trainer.optimiser.restore(state, info.step).map_err(|e| e.in_file(&path))?;
            trainer.veni = weights::write(trainer.veni, "", &trainer.optimiser.weights())?;
            trainer.best = info.best;
        }
        Ok(trainer)
    }

    fn fresh(folder: &Path, config: TrainConfig, splits: Splits, command: &str) -> Result<Self> {
        let device = config.device.device()?.autodiff();
        let veni = Veni::new(&config.model, &mut stream(config.seed, Purpose::Weights, 0, 0), &device)?;
        let groups = GROUPS.iter().zip([&config.decoder, &config.encoder]);
        let groups =
            groups.map(|(prefix, group)| Group { prefix: (*prefix).into(), adam: group.adam }).collect();
        let optimiser = Optimiser::new(&veni, groups, config.ema_decay)?;
        let [height, width] = [config.data.height, config.data.width].map(|n| n / config.loss_grid.factor());
        let loss = Loss::new(&config.loss, height, width, &device);
        let (folder, command) = (folder.to_path_buf(), command.to_owned());
        Ok(Self { folder, config, splits, command, device, loss, veni, optimiser, best: None })
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
    pub fn network(&self) -> &Veni {
        &self.veni
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
        let batches = Batches::new(&self.config, self.veni.stripes()?, &splits.train);
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
        batches: mpsc::Receiver<Batch>,
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
    fn update(&mut self, batch: &Batch) -> Result<StepReport> {
        let clock = Instant::now();
        let loss = batch_loss(&self.veni, batch, &self.loss, &self.device);
        let total = loss.terms.total();
        let value = f64::from(total.clone().into_scalar::<f32>());
        if !value.is_finite() {
            return Err(Error::invalid(format!(
                "the loss is {value} at update {}: lower the learning rates or the clipping norm",
                batch.step
            )));
        }
        let gradients = total.backward();
        // schedules count from 0: with a warm-up the first update has rate 0, as the authors' has
        let rates =
            [&self.config.decoder, &self.config.encoder].map(|group| group.learning_rate.at(batch.step - 1));
        let (veni, groups) = self.optimiser.step(self.veni.clone(), &gradients, &rates);
        self.veni = veni;
        let seconds = clock.elapsed().as_secs_f64();
        let by_name =
            |f: &dyn Fn(usize) -> f64| GROUPS.iter().enumerate().map(|(i, name)| (*name, f(i))).collect();
        Ok(StepReport {
            step: batch.step,
            loss: value,
            parts: loss
                .terms
                .terms
                .into_iter()
                .map(|t| (t.name, f64::from(t.value.into_scalar::<f32>())))
                .collect(),
            learning_rate: by_name(&|i| groups[i].learning_rate),
            gradient_norm: by_name(&|i| groups[i].gradient_norm),
            seconds,
            images_per_second: batch.images as f64 / seconds,
        })
    }

    /// The network that is validated and stored: averaged weights, no gradients.
    fn averaged(&self) -> Result<Veni> {
        let weights =
            if self.config.ema_decay > 0.0 { self.optimiser.averages() } else { self.optimiser.weights() };
        Ok(weights::write(self.veni.clone(), "", &weights)?.valid())
    }

    fn validate(&mut self, log: &mut MetricsLog, progress: &mut dyn Progress) -> Result<()> {
        let veni = self.averaged()?;
        let subset = self.config.report.train_subset.min(self.splits.train.len());
        let subset = Dataset::new(self.splits.train.grid(), self.splits.train.items()[..subset].to_vec());
        let mean = |set: &Dataset| match set.is_empty() {
            true => Ok(None),
            false => Reconstruction::autoencoder(&veni, set, Alignment::LogFactor).map(|r| Some(r.mean)),
        };
        let (val, train) = (mean(&self.splits.val)?, mean(&subset)?);
        let step = self.steps_done();
        // without validation panoramas the last weights are the best known
        let best = match (val, self.best) {
            (Some(now), Some(best)) => now.ldr_psnr > best.ldr_psnr,
            _ => true,
        };
        if best {
            self.best = val.map(|scores| Best { step, ldr_psnr: scores.ldr_psnr });
            self.store(&veni, 0, step, progress)?;
        }
        let report = ValidationReport { step, val, train, best };
        log.append(&Record { step, validation: &report })?;
        progress.validation(&report);
        Ok(())
    }

    /// Writes `model.safetensors`; the prior is fitted to the training panoramas and `copies` augmented copies.
    fn store(&self, veni: &Veni, copies: usize, step: u64, progress: &mut dyn Progress) -> Result<()> {
        let prior = self.prior(veni, copies)?;
        let data: Vec<_> = self.config.data.folders.iter().filter_map(|f| f.file_name()).collect();
        let data = data.iter().map(|f| f.to_string_lossy()).collect::<Vec<_>>().join(", ");
        let info = ModelInfo {
            training: Some(Training {
                data: format!("{} panoramas of {data}", self.splits.train.len()),
                steps: step,
                seed: self.config.seed,
                command: self.command.clone(),
                ..Training::default()
            }),
            prior: Some(format!("{} training latents", (1 + copies) * self.splits.train.len())),
            ..ModelInfo::default()
        };
        let mut model = veni.to_model(&self.config.model, info)?;
        model.set_prior(&prior)?;
        let path = self.folder.join("model.safetensors");
        model.save(&path, self.config.report.stored.into(), Overwrite::Replace)?;
        progress.wrote(&path);
        Ok(())
    }

    fn prior(&self, veni: &Veni, copies: usize) -> Result<Prior> {
        let train = &self.splits.train;
        let batches = Batches::new(&self.config, veni.stripes()?, train);
        let (mut codes, mut variances) = (Vec::new(), Vec::new());
        for copy in 0..=copies {
            let images: Vec<_> = (train.items().iter().enumerate())
                // slots beyond any batch: copies that no update has seen
                .map(|(i, item)| match copy {
                    0 => item.log_radiance.clone(),
                    _ => batches.augmented(i, u64::MAX, (copy * train.len() + i) as u64),
                })
                .collect();
            let views: Vec<_> = images.iter().map(Vec::as_slice).collect();
            for (encoded, item) in veni.encode(train.grid(), &views)?.into_iter().zip(train.items()) {
                codes.push(Latent { log_exposure: item.log_exposure, ..Latent::new(encoded.vectors) });
                variances.extend(encoded.variances);
            }
        }
        if codes.len() < 2 {
            return Ok(Prior::standard(veni.latent_vectors()));
        }
        Prior::fit(&codes, (!variances.is_empty()).then_some(variances.as_slice()))
    }

    fn preview(&self, progress: &mut dyn Progress) -> Result<()> {
        let veni = self.averaged()?;
        let step = self.steps_done();
        let prior = self.prior(&veni, 0)?;
        // validation panoramas first: they say more
        let items: Vec<_> =
            self.splits.val.items().iter().chain(self.splits.train.items()).take(PREVIEW_ROWS).collect();
        let grid = self.splits.train.grid();
        let images: Vec<_> = items.iter().map(|i| i.log_radiance.as_slice()).collect();
        let latents: Vec<_> = veni.encode(grid, &images)?.into_iter().map(|e| e.vectors).collect();
        let mut rng = stream(self.config.seed, Purpose::Preview, 0, 0);
        let samples: Vec<_> = items.iter().map(|_| Latent::sample(&prior, &mut rng).vectors).collect();
        let decoded = veni.decode(grid, &latents).into_iter().zip(veni.decode(grid, &samples));
        let rows: Vec<_> = (items.iter().zip(decoded))
            .map(|(item, (reconstruction, sample))| vec![item.log_radiance.clone(), reconstruction, sample])
            .collect();
        let path = self.folder.join("preview").join(format!("step-{step:06}.png"));
        preview::write(&path, grid, &rows)?;
        progress.wrote(&path);
        Ok(())
    }

    fn checkpoint(&self, progress: &mut dyn Progress) -> Result<()> {
        let path = self.checkpoint_path();
        checkpoint::save(&path, &self.optimiser.state(), &CheckpointInfo::new(self.steps_done(), self.best))?;
        progress.wrote(&path);
        Ok(())
    }

    /// The last validation and preview, then the best model again with the full prior.
    fn finish(&mut self, log: &mut MetricsLog, progress: &mut dyn Progress) -> Result<()> {
        self.validate(log, progress)?;
        self.preview(progress)?;
        let path = self.folder.join("model.safetensors");
        let model = Model::load(&path)?;
        let step = model.info().training.as_ref().map_or(self.steps_done(), |t| t.steps);
        // from here on the file is complete, and stays: the stored weights, not the last ones
        let veni = Veni::from_model(&model, &self.config.device.device()?)?;
        self.store(&veni, self.config.report.prior_copies, step, progress)
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
