//! What may be said to a run that goes on.

use std::path::Path;

use anyhow::{Context, Result, bail};
use veni_data::PixelStorage;

use super::args::Train;
use super::config::read;
use super::pixel_storage::storage_key;

impl Train {
    /// With `--resume`: whatever else was typed must be what the run was begun with, but for where its panoramas are kept.
    pub(super) fn check_same(&self, stored: &Path) -> Result<()> {
        let described = !self.data.is_empty() || self.config.is_some();
        let begun = self.init.is_some() || self.pretrains() || self.pretrain_steps.is_some();
        let changed = begun
            || self.system.is_some()
            || self.preset.is_some()
            || self.latent_vectors.is_some()
            || self.seed.is_some()
            || self.steps.is_some()
            || self.synthetic.is_some()
            || self.fold.is_some()
            || self.layer.is_some()
            || self.device.is_some()
            || self.devices.is_some()
            || self.mixed_precision
            || self.set.iter().any(|set| storage_key(set).is_none());
        if !described && !changed {
            return Ok(());
        }
        if !described {
            bail!(
                "{}: a run continues with its own settings: leave the other options out, or give --data and all that \
                 it was begun with",
                self.out.display()
            );
        }
        let (old, mut new) = (read(stored)?, self.settings()?);
        if let (Some(old), Some(new)) = (&old.init, &mut new.init) {
            // known only once the model was read
            new.digest = new.digest.take().or_else(|| old.digest.clone());
        }
        if !self.names_devices() {
            // another machine may have other threads to share
            new.devices.clone_from(&old.devices);
        }
        let storage = self.pixel_storage(stored)?;
        let (old, new) =
            (old.with_pixel_storage(&storage).to_toml()?, new.with_pixel_storage(&storage).to_toml()?);
        let differing = old.lines().zip(new.lines()).find(|(a, b)| a != b);
        match differing {
            Some((old, new)) => bail!(
                "{}: the run was begun with '{old}', not '{new}'; leave the options out to go on with its own \
                 settings, or name another --out",
                self.out.display()
            ),
            None if old.lines().count() != new.lines().count() => {
                bail!(
                    "{}: the run was begun with other settings; leave the options out to go on",
                    self.out.display()
                )
            }
            None => Ok(()),
        }
    }

    /// Where `--set` says that the panoramas are kept from now on.
    pub(super) fn pixel_storage(&self, stored: &Path) -> Result<PixelStorage> {
        let set: Vec<_> = self.set.iter().filter(|set| storage_key(set).is_some()).collect();
        let data = read(stored)?.with_overrides(&set).context("--set")?.data;
        let given = |key| set.iter().any(|set| storage_key(set) == Some(key));
        Ok(PixelStorage {
            memory_mib: given("memory_mib").then_some(data.memory_mib),
            scratch: given("scratch").then_some(data.scratch).flatten(),
        })
    }
}
