//! How a run comes into being, or back.

use std::collections::HashSet;
use std::fs;
use std::io::Write;

use super::folder::{FOLDERS, clear_leftovers, record_command, recorded_command, refuse_used};
use super::*;
use crate::train::init::{self, InitConfig};
use veni_data::PixelStorage;
use veni_light::limits::{MAX_SETTINGS_BYTES, read_text};
use veni_light::model::Model;
use veni_light::output::{Lock, Overwrite, existing_above, write_atomic};
use veni_light::progress::{Observer, Silent};

impl Trainer {
    /// Starts a run in `folder`, which must be free ([`is_free`]). `command` is recorded in the model file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the folder is in use or the configuration does not fit; what reading the data says.
    pub fn create(folder: &Path, config: TrainConfig, command: &str) -> Result<Self> {
        refuse_used(folder)?;
        let mut trainer = Self::prepare(folder, config, command, &Silent)?;
        trainer.begin(None)?;
        Ok(trainer)
    }

    /// A run that is yet to [`begin`](Self::begin): its data and the weights that it starts from are read, nothing is
    /// written. The progress of reading the data is reported to `observer`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the configuration does not fit; what reading data and weights says.
    pub fn prepare(
        folder: &Path,
        mut config: TrainConfig,
        command: &str,
        observer: &dyn Observer,
    ) -> Result<Self> {
        config.check()?;
        let init = config.init.as_mut().map(InitConfig::open).transpose()?;
        Self::fresh(folder, config, command, init.as_ref(), 0, observer)
    }

    /// Makes the run's folder: from here on it can be continued. `lock` is the folder's ([`lock`]) if the caller has it
    /// already.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process has a run in the folder; [`Error::Invalid`] if the folder is in use or a link in it
    /// leads elsewhere; [`Error::Io`] if it cannot be written to.
    pub fn begin(&mut self, lock: Option<Lock>) -> Result<()> {
        refuse_used(&self.folder)?;
        let lock = match lock {
            Some(lock) => lock,
            None => {
                fs::create_dir_all(&self.folder).map_err(|e| Error::io(&self.folder, "create", e))?;
                let lock = super::lock(&self.folder)?;
                // another process may have begun, and ended, before the lock was taken
                refuse_used(&self.folder)?;
                lock
            }
        };
        self.lock = Some(lock);
        clear_leftovers(&self.folder)?;
        self.make_folders()?;
        let checkpoint = self.checkpoint_path();
        if self.initialised.is_some() {
            // to resume from here the model will not be needed again
            checkpoint::save(&checkpoint, &self.optimiser.state(), &CheckpointInfo::new(0, None))?;
        } else if checkpoint.exists() {
            fs::remove_file(&checkpoint).map_err(|e| Error::io(&checkpoint, "remove", e))?;
        }
        record_command(&self.folder, &self.command)?;
        // last: a folder with this file is a run
        let text = self.config.to_toml()?;
        let path = self.folder.join("config.toml");
        write_atomic(&path, Overwrite::Replace, |out| {
            out.write_all(text.as_bytes()).map_err(|e| Error::io(&path, "write", e))
        })
    }

    /// Continues the run in `folder` from its checkpoint (or from the start, if it was ended before its first). `command` is
    /// recorded in the model file if the run itself does not say how it was begun.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process has it; [`Error::Io`] or [`Error::Invalid`] if `config.toml` or the checkpoint cannot be read or do not fit together.
    pub fn resume(folder: &Path, command: &str) -> Result<Self> {
        Self::resume_with(folder, command, &PixelStorage::default(), &Silent)
    }

    /// [`Trainer::resume`], with panoramas kept as `storage` says (`config.toml` keeps what it says of that), reporting the
    /// progress of reading the data.
    ///
    /// # Errors
    /// As [`Trainer::resume`].
    pub fn resume_with(
        folder: &Path,
        command: &str,
        storage: &PixelStorage,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let path = folder.join("config.toml");
        let text = read_text(&path, "a configuration", MAX_SETTINGS_BYTES)?;
        let config = TrainConfig::from_toml(&text).map_err(|e| e.in_file(&path))?.with_pixel_storage(storage);
        let lock = super::lock(folder)?;
        clear_leftovers(folder)?;
        let begun = recorded_command(folder)?;
        let command = begun.as_deref().unwrap_or(command);
        let path = checkpoint_path(folder);
        let state = if path.exists() { Some(checkpoint::load(&path)?) } else { None };
        if let (None, Some(init)) = (&state, &config.init) {
            return Err(Error::invalid(format!(
                "is missing, and with it the weights that the run took from {}; start the run over",
                init.model.display()
            ))
            .in_file(&path));
        }
        let done = state.as_ref().map_or(0, |(_, info)| info.step);
        let mut trainer = Self::fresh(folder, config, command, None, done, observer)?;
        trainer.lock = Some(lock);
        trainer.make_folders()?;
        if let Some((state, info)) = state {
            trainer.optimiser.restore(state, info.step).map_err(|e| e.in_file(&path))?;
            trainer.replicas.write(trainer.optimiser.weights())?;
            trainer.best = info.best;
        }
        Ok(trainer)
    }

    /// A run with the weights of its beginning, and the panoramas of the stages that are left after `done` updates.
    fn fresh(
        folder: &Path,
        config: TrainConfig,
        command: &str,
        init: Option<&Model>,
        done: u64,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let opened = config.device.open_all(&config.devices)?;
        let devices: Vec<_> = opened.into_iter().map(|opened| opened.device.autodiff()).collect();
        config.decoder_backend.check()?;
        let scratch = existing_above(folder);
        let splits =
            Splits::open_observed(&config.data, config.seed, config.model.lights, scratch, observer)?;
        let running = |stage: Stage| -> Result<Running> {
            let needed = stage.own_data && stage.end() > done;
            let data = needed.then(|| own_data(&stage, &splits.val, scratch, observer)).transpose()?;
            Ok(Running { stage, data })
        };
        let stages = config.stages()?.into_iter().map(running).collect::<Result<_>>()?;
        let mut network = Network::new(&config, splits.train.len(), &devices[0])?;
        let mut initialised = None;
        if let (Some(model), Some(settings)) = (init, &config.init) {
            let (taken, said) =
                init::apply(network, &config, model).map_err(|e| e.in_file(&settings.model))?;
            (network, initialised) = (taken, Some(said));
        }
        let optimiser = Optimiser::new(&network, groups(&config), config.ema_decay)?;
        let replicas = Replicas::new(network, &config, &devices)?;
        let (folder, command, best) = (folder.to_path_buf(), command.to_owned(), None);
        Ok(Self {
            folder,
            lock: None,
            config,
            splits,
            stages,
            command,
            replicas,
            optimiser,
            best,
            initialised,
        })
    }

    fn make_folders(&self) -> Result<()> {
        for inner in FOLDERS {
            let inner = self.folder.join(inner);
            fs::create_dir_all(&inner).map_err(|e| Error::io(&inner, "create", e))?;
        }
        Ok(())
    }
}

/// The training panoramas of a stage, without those that validate the run.
fn own_data(stage: &Stage, val: &Dataset, scratch: &Path, observer: &dyn Observer) -> Result<Dataset> {
    let name = stage.name.as_deref().unwrap_or_default();
    let named = |e: Error| Error::invalid(format!("stage {name}: {}", e.with_source()));
    let TrainConfig { data, seed, model, .. } = &stage.config;
    let train = Splits::open_observed(data, *seed, model.lights, scratch, observer).map_err(named)?.train;
    let file = |path: &Path| fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let held_out: HashSet<_> = val.items().iter().map(|item| file(&item.path)).collect();
    let kept = train.retain(|item| !held_out.contains(&file(&item.path)));
    if kept.is_empty() {
        return Err(named(Error::invalid("all of its panoramas are the run's validation panoramas")));
    }
    Ok(kept)
}
