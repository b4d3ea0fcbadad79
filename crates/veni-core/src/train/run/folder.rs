//! A run's folder: whose it is, what may be in it, and how the run was begun.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::checkpoint_path;
use crate::train::checkpoint;
use crate::{Error, Result};
use veni_light::output::{Lock, Overwrite, below, remove_if_left, write_atomic};
use veni_light::text::decode;

/// Folders inside a run's.
pub(super) const FOLDERS: [&str; 2] = ["checkpoint", "preview"];
/// The file that is locked by the process that trains.
const LOCK: &str = ".lock";
/// The file with the command that began the run.
const COMMAND: &str = "command.txt";
/// What is written in place, or holds what is.
const IN_PLACE: [&str; 4] = [LOCK, "metrics.jsonl", FOLDERS[0], FOLDERS[1]];

/// Makes sure that nobody else trains in `folder`, which exists, as long as the result lives, and that what a run writes stays
/// in it.
///
/// # Errors
/// [`Error::Busy`] if another process does; [`Error::Invalid`] if one of a run's files is a symbolic link.
pub fn lock(folder: &Path) -> Result<Lock> {
    for name in IN_PLACE {
        below(folder, name)?;
    }
    Lock::exclusive(&folder.join(LOCK))
}

/// Writes down the command that begins the run.
pub(super) fn record_command(folder: &Path, command: &str) -> Result<()> {
    let path = folder.join(COMMAND);
    write_atomic(&path, Overwrite::Replace, |out| {
        writeln!(out, "{command}").map_err(|e| Error::io(&path, "write", e))
    })
}

/// The command that began the run; runs of older versions do not say.
pub(super) fn recorded_command(folder: &Path) -> Result<Option<String>> {
    let path = folder.join(COMMAND);
    match fs::read(&path) {
        Ok(bytes) => Ok(Some(decode(bytes).map_err(|e| e.in_file(&path))?.trim_end().to_owned())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::io(&path, "read", e)),
    }
}

/// Refuses a folder in which no run may begin.
pub(super) fn refuse_used(folder: &Path) -> Result<()> {
    if is_free(folder)? {
        return Ok(());
    }
    Err(Error::invalid("is not empty; continue the run in it, or name a new folder").in_file(folder))
}

/// Removes half-written files of processes that are no more.
pub(super) fn clear_leftovers(folder: &Path) -> Result<()> {
    for left in leftovers(folder)? {
        remove_if_left(&left);
    }
    Ok(())
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
    let known = [LOCK, COMMAND].map(|name| folder.join(name));
    for path in entries(folder)?.into_iter().filter(|path| !known.contains(path)) {
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
    // a link in a run's folder leads to what is not the run's
    let inner = FOLDERS.map(|inner| folder.join(inner)).into_iter().filter(|inner| !inner.is_symlink());
    for folder in std::iter::once(folder.to_path_buf()).chain(inner) {
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
