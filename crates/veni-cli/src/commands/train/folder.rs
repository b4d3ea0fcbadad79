//! The folder of a run: whether it may be used, and clearing it.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use veni_core::train::run::{is_free, leftovers, lock};
use veni_light::Error;
use veni_light::output::{Lock, existing_above};

use super::args::Train;
use crate::output::{with_remedy, writable};

/// What a run writes into its folder.
const FILES: [&str; 5] =
    ["config.toml", "command.txt", "metrics.jsonl", "model.safetensors", "latents.safetensors"];
const FOLDERS: [&str; 2] = ["checkpoint", "preview"];
/// What stays in it, since another process may be waiting for it.
const LOCK: &str = ".lock";

impl Train {
    /// Refuses a folder in use before the data is read. The lock on it if there is a run to clear away (`--force`).
    pub(super) fn check_folder(&self) -> Result<Option<Lock>> {
        let out = &self.out;
        if !out.exists() {
            return writable(existing_above(out), out).map(|()| None);
        }
        if !out.is_dir() {
            bail!("{}: is a file; name a folder for the run with --out", out.display());
        }
        writable(out, out)?;
        if is_free(out)? {
            return Ok(None);
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
        let lock = lock(out).map_err(with_remedy)?;
        let left = leftovers(out)?;
        for path in [list(out)?, list(&out.join(FOLDERS[0]))?, list(&out.join(FOLDERS[1]))?].concat() {
            let name = path.strip_prefix(out).unwrap_or(&path);
            if !left.contains(&path) && !is_of_a_run(name) {
                bail!(
                    "{}: holds {} beside its run; name a new folder with --out",
                    out.display(),
                    name.display()
                );
            }
        }
        Ok(Some(lock))
    }

    /// Removes a run's files; those of others were refused before.
    pub(super) fn clear(&self) -> Result<()> {
        for folder in FOLDERS.map(|folder| self.out.join(folder)) {
            for file in list(&folder)? {
                remove(&file, |p| std::fs::remove_file(p))?;
            }
            remove(&folder, |p| std::fs::remove_dir(p))?;
        }
        for file in leftovers(&self.out)?.into_iter().chain(FILES.map(|file| self.out.join(file))) {
            remove(&file, |p| std::fs::remove_file(p))?;
        }
        Ok(())
    }
}

/// Whether a run writes a file or folder of this name, which is relative to its own.
fn is_of_a_run(name: &Path) -> bool {
    let Some(file) = name.file_name().and_then(|file| file.to_str()) else { return false };
    match name.parent().and_then(Path::to_str) {
        Some("") => FILES.iter().chain(&FOLDERS).chain([&LOCK]).any(|known| file == *known),
        Some("checkpoint") => file == "state.safetensors",
        Some("preview") => file.starts_with("step-") && file.ends_with(".png"),
        _ => false,
    }
}

/// What is in a folder; nothing if it is not there.
fn list(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let failed = |e| Error::io(folder, "list", e);
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    Ok(entries.map(|entry| entry.map(|e| e.path())).collect::<std::io::Result<_>>().map_err(failed)?)
}

fn remove(path: &Path, how: impl Fn(&Path) -> std::io::Result<()>) -> Result<()> {
    if path.symlink_metadata().is_ok() {
        how(path).map_err(|e| Error::io(path, "remove", e))?;
    }
    Ok(())
}
