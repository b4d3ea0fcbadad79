//! How a run comes into being, or back.

use std::collections::HashSet;
use std::fs;
use std::io::Write;

use super::*;
use crate::train::init::{self, InitConfig};
use veni_data::PixelStorage;
use veni_light::limits::{MAX_SETTINGS_BYTES, read_text};
use veni_light::model::Model;
use veni_light::output::{Overwrite, existing_above, write_atomic};
use veni_light::progress::{Observer, Silent};

impl Trainer {
    /// Starts a run in `folder`, which must be free ([`is_free`]). `command` is recorded in the model file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the folder is in use or the configuration does not fit; what reading the data says.
    pub fn create(folder: &Path, config: TrainConfig, command: &str) -> Result<Self> {
        refuse_used(folder)?;
        let trainer = Self::prepare(folder, config, command, &Silent)?;
        trainer.begin()?;
        Ok(trainer)
    }

    /// A run that is yet to [`begin`](Self::begin): its data and the weights that it starts from are read, nothing is
    /// written. `observer` is told how far reading the data has come.
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

    /// Makes the run's folder: from here on it can be continued.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the folder is in use, [`Error::Io`] if it cannot be written to.
    pub fn begin(&self) -> Result<()> {
        refuse_used(&self.folder)?;
        for left in leftovers(&self.folder)? {
            fs::remove_file(&left).map_err(|e| Error::io(&left, "remove", e))?;
        }
        self.make_folders()?;
        let checkpoint = self.checkpoint_path();
        if self.initialised.is_some() {
            // to go on from here the model will not be needed again
            checkpoint::save(&checkpoint, &self.optimiser.state(), &CheckpointInfo::new(0, None))?;
        } else if checkpoint.exists() {
            fs::remove_file(&checkpoint).map_err(|e| Error::io(&checkpoint, "remove", e))?;
        }
        // last: a folder with this file is a run
        let text = self.config.to_toml()?;
        let path = self.folder.join("config.toml");
        write_atomic(&path, Overwrite::Replace, |out| {
            out.write_all(text.as_bytes()).map_err(|e| Error::io(&path, "write", e))
        })
    }

    /// Continues the run in `folder` from its checkpoint (or from the start, if it was ended before its first).
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Invalid`] if `config.toml` or the checkpoint cannot be read or do not fit together.
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
        for left in leftovers(folder)? {
            fs::remove_file(&left).map_err(|e| Error::io(&left, "remove", e))?;
        }
        let path = checkpoint_path(folder);
        let state = if path.exists() { Some(checkpoint::load(&path)?) } else { None };
        if let (None, Some(init)) = (&state, &config.init) {
            return Err(Error::invalid(format!(
                "{}: is missing, and with it the weights that the run took from {}; start the run over",
                path.display(),
                init.model.display()
            )));
        }
        let done = state.as_ref().map_or(0, |(_, info)| info.step);
        let mut trainer = Self::fresh(folder, config, command, None, done, observer)?;
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
        let splits = Splits::open_observed(&config.data, config.seed, scratch, observer)?;
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
        Ok(Self { folder, config, splits, stages, command, replicas, optimiser, best, initialised })
    }

    fn make_folders(&self) -> Result<()> {
        for inner in FOLDERS {
            let inner = self.folder.join(inner);
            fs::create_dir_all(&inner).map_err(|e| Error::io(&inner, "create", e))?;
        }
        Ok(())
    }
}

fn refuse_used(folder: &Path) -> Result<()> {
    if is_free(folder)? {
        return Ok(());
    }
    let folder = folder.display();
    Err(Error::invalid(format!("{folder}: is not empty; continue the run in it, or name a new folder")))
}

/// Folders inside a run's.
const FOLDERS: [&str; 2] = ["checkpoint", "preview"];

/// The training panoramas of a stage, without those that validate the run.
fn own_data(stage: &Stage, val: &Dataset, scratch: &Path, observer: &dyn Observer) -> Result<Dataset> {
    let name = stage.name.as_deref().unwrap_or_default();
    let named = |e: Error| Error::invalid(format!("stage {name}: {}", e.with_source()));
    let train =
        Splits::open_observed(&stage.config.data, stage.config.seed, scratch, observer).map_err(named)?.train;
    let file = |path: &Path| fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let held_out: HashSet<_> = val.items().iter().map(|item| file(&item.path)).collect();
    let kept = train.retain(|item| !held_out.contains(&file(&item.path)));
    if kept.is_empty() {
        return Err(named(Error::invalid("all of its panoramas are the run's validation panoramas")));
    }
    Ok(kept)
}

/// Whether a run may begin in `folder`: it does not exist, is empty, or holds nothing but what a run leaves that was
/// ended while it began.
///
/// # Errors
/// [`Error::Io`] if a folder cannot be listed, or a checkpoint not read.
pub fn is_free(folder: &Path) -> Result<bool> {
    if !folder.exists() {
        return Ok(true);
    }
    let left = leftovers(folder)?;
    let entries = |folder: &Path| -> Result<Vec<PathBuf>> {
        let list = |e| Error::io(folder, "list", e);
        let entries = fs::read_dir(folder).map_err(list)?;
        let paths = entries.map(|entry| entry.map(|e| e.path()).map_err(list)).collect::<Result<Vec<_>>>()?;
        Ok(paths.into_iter().filter(|path| !left.contains(path)).collect())
    };
    let inner = FOLDERS.map(|name| folder.join(name));
    for path in entries(folder)? {
        if !inner.contains(&path) || !path.is_dir() {
            return Ok(false);
        }
        for file in entries(&path)? {
            // weights that a run was to begin with
            if file != checkpoint_path(folder) || checkpoint::load(&file)?.1.step > 0 {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Half-written files in a run's folder, which a process left that was killed while it wrote them.
///
/// # Errors
/// [`Error::Io`] if a folder cannot be listed.
pub fn leftovers(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for folder in std::iter::once(folder.to_path_buf()).chain(FOLDERS.map(|inner| folder.join(inner))) {
        if !folder.is_dir() {
            continue;
        }
        for entry in fs::read_dir(&folder).map_err(|e| Error::io(&folder, "list", e))? {
            let path = entry.map_err(|e| Error::io(&folder, "list", e))?.path();
            if veni_light::output::is_part(&path) {
                found.push(path);
            }
        }
    }
    Ok(found)
}
