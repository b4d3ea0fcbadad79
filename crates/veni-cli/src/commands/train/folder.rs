//! The folder of a run: whether it may be used, and clearing it.

use std::path::Path;

use anyhow::{Result, bail};
use veni_core::train::run::{is_free, leftovers};
use veni_light::Error;
use veni_light::output::existing_above;

use super::args::Train;
use crate::output::writable;

/// What a run writes into its folder.
const FILES: [&str; 4] = ["config.toml", "metrics.jsonl", "model.safetensors", "latents.safetensors"];
const FOLDERS: [&str; 2] = ["checkpoint", "preview"];

impl Train {
    /// Refuses a folder in use before the data is read. Whether there is a run to clear away (`--force`).
    pub(super) fn check_folder(&self) -> Result<bool> {
        let out = &self.out;
        if !out.exists() {
            return writable(existing_above(out), out).map(|()| false);
        }
        if !out.is_dir() {
            bail!("{}: is a file; name a folder for the run with --out", out.display());
        }
        writable(out, out)?;
        if is_free(out)? {
            return Ok(false);
        }
        if !out.join("config.toml").is_file() {
            bail!("{}: is not empty and no run either; name a new folder with --out", out.display());
        }
        if !self.force {
            bail!(
                "{}: holds a run already; --resume continues it, --force starts over in its place",
                out.display()
            );
        }
        let left = leftovers(out)?;
        for entry in std::fs::read_dir(out).map_err(|e| Error::io(out, "list", e))? {
            let entry = entry.map_err(|e| Error::io(out, "list", e))?;
            let name = entry.file_name();
            if !left.contains(&entry.path()) && !FILES.iter().chain(&FOLDERS).any(|known| name == *known) {
                bail!(
                    "{}: holds {} beside its run; name a new folder with --out",
                    out.display(),
                    name.display()
                );
            }
        }
        Ok(true)
    }

    /// Removes a run's files.
    pub(super) fn clear(&self) -> Result<()> {
        for file in leftovers(&self.out)? {
            remove(&file, |p| std::fs::remove_file(p))?;
        }
        for file in FILES {
            remove(&self.out.join(file), |p| std::fs::remove_file(p))?;
        }
        for folder in FOLDERS {
            remove(&self.out.join(folder), |p| std::fs::remove_dir_all(p))?;
        }
        Ok(())
    }
}

fn remove(path: &Path, how: impl Fn(&Path) -> std::io::Result<()>) -> Result<()> {
    if path.exists() {
        how(path).map_err(|e| Error::io(path, "remove", e))?;
    }
    Ok(())
}
