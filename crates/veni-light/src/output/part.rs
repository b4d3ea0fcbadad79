//! The unfinished file beside a target. Its owner holds a lock on it: one that nobody holds was left by a process that was
//! killed, and is removed by the next one that writes into its folder.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use super::left::{remove_folder_if_left, remove_if_left};
use crate::{Error, Result};

/// The unfinished files of this process.
static LIVE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
/// The folders in which this process has looked for what others left.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
const EXTENSION: &str = "part";

/// An unfinished file; it goes with this value unless it was [`finish`](Part::finish)ed.
#[derive(Debug)]
pub(super) struct Part(PathBuf);

impl Part {
    /// A new, locked file beside `target`, whose name is `name`.
    pub(super) fn create(target: &Path, name: &std::ffi::OsStr) -> io::Result<(Self, File)> {
        if let Some(folder) = target.parent() {
            sweep(folder);
        }
        loop {
            let path = target.with_file_name(hidden(name));
            let (part, file) = {
                let mut live = live();
                let file = OpenOptions::new().write(true).create_new(true).open(&path)?;
                live.insert(path.clone());
                (Self(path), file)
            };
            // a sweep may have been quicker than the lock: then the name is gone, or about to go
            match file.try_lock() {
                Ok(()) if part.0.symlink_metadata().is_ok() => return Ok((part, file)),
                Ok(()) | Err(fs::TryLockError::WouldBlock) => {}
                // no locks in this file system: no sweep can have one either
                Err(fs::TryLockError::Error(_)) => return Ok((part, file)),
            }
        }
    }

    /// Gives the file its final name by `publish`, which is told the present one. An [`abandon`] comes before or after it.
    pub(super) fn finish(self, publish: impl FnOnce(&Path) -> io::Result<()>) -> io::Result<()> {
        let mut live = live();
        publish(&self.0)?;
        live.remove(&self.0);
        Ok(())
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        let mut live = live();
        if live.remove(&self.0) {
            // best effort: the error already on its way says more than a failed clean-up would
            let _ = fs::remove_file(&self.0);
        }
    }
}

/// While it exists no file is begun or finished.
#[derive(Debug)]
#[must_use = "files can be written again once it is dropped"]
pub struct Abandoned {
    _live: MutexGuard<'static, BTreeSet<PathBuf>>,
}

/// Removes the unfinished files of this process, which is about to end: other threads wait as long as the result is held.
pub fn abandon() -> Abandoned {
    let mut live = live();
    // what is in a folder comes behind it
    for path in std::mem::take(&mut *live).into_iter().rev() {
        // there is nobody left to tell
        let _ = fs::remove_file(&path).or_else(|_| fs::remove_dir(&path));
    }
    Abandoned { _live: live }
}

/// Has a file, or an empty folder, of the caller's removed by [`abandon`]; [`forget`] takes that back.
pub fn remember(path: &Path) {
    live().insert(path.to_path_buf());
}

/// Leaves a file alone that was [`remember`]ed.
pub fn forget(path: &Path) {
    live().remove(path);
}

/// Whether this is the unfinished file of a [`write_atomic`](super::write_atomic), by its name: `.NAME.TOKEN-COUNT.part`.
pub fn is_part(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let stem = name.strip_prefix('.').and_then(|name| name.strip_suffix(".part"));
    let made = stem.and_then(|stem| stem.rsplit_once('.')).and_then(|(_, made)| made.split_once('-'));
    made.is_some_and(|(token, count)| {
        let is_hex = token.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
        token.len() == 16 && is_hex && !count.is_empty() && count.bytes().all(|b| b.is_ascii_digit())
    })
}

/// A number that no other process is likely to have: process numbers repeat from machine to machine, and several may
/// write to one file system.
pub fn process_token() -> u64 {
    use std::hash::{BuildHasher, RandomState};
    static TOKEN: OnceLock<u64> = OnceLock::new();
    *TOKEN.get_or_init(|| RandomState::new().hash_one(std::process::id()))
}

/// Removes the unfinished files in `folder` that no process has any more, once in the life of this one.
fn sweep(folder: &Path) {
    let mut swept = SWEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if !swept.insert(folder.to_path_buf()) {
        return;
    }
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(entries) = fs::read_dir(folder) else { return };
    for path in entries.filter_map(|entry| entry.ok().map(|e| e.path())).filter(|p| is_part(p)) {
        if path.symlink_metadata().is_ok_and(|meta| meta.is_dir()) {
            remove_folder_if_left(&path);
        } else {
            remove_if_left(&path);
        }
    }
}

/// The name of an unfinished file or folder beside `target`, which nothing has, after what others left there was removed.
///
/// # Errors
/// [`Error::Invalid`] if `target` is not a name of something in a folder.
pub fn part_beside(target: &Path) -> Result<PathBuf> {
    let name =
        target.file_name().ok_or_else(|| Error::invalid("is not a name to write to").in_file(target))?;
    target.parent().into_iter().for_each(sweep);
    Ok(target.with_file_name(hidden(name)))
}

/// A panic while the set was held came from a publication that is over.
fn live() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    LIVE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn hidden(name: &std::ffi::OsStr) -> OsString {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut hidden = OsString::from(".");
    hidden.push(short(name));
    hidden.push(format!(".{:016x}-{}.{EXTENSION}", process_token(), COUNT.fetch_add(1, Ordering::Relaxed)));
    hidden
}

/// A name that leaves room for what is added to it: file systems have 255 bytes for each.
fn short(name: &std::ffi::OsStr) -> std::borrow::Cow<'_, std::ffi::OsStr> {
    const MOST: usize = 200;
    if name.len() <= MOST {
        return name.into();
    }
    let name = name.to_string_lossy();
    OsString::from(&name[..name.floor_char_boundary(MOST)]).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unfinished_files_are_known_by_name() {
        for name in [".a.exr.0123456789abcdef-0.part", "x/.b..json.ffffffffffffffff-17.part"] {
            assert!(is_part(Path::new(name)), "{name}");
        }
        for name in [
            ".a.part",
            "a.exr.0123456789abcdef-0.part",
            ".a.exr.0123456789abcdef-.part",
            ".a.exr.0123456789ABCDEF-0.part",
            ".a.exr.0123456789abcde-0.part",
            ".part",
        ] {
            assert!(!is_part(Path::new(name)), "{name} is a user's own");
        }
        assert!(is_part(Path::new(&hidden("sky.exr".as_ref()))));
        let long = "ä".repeat(125) + ".exr";
        assert!(hidden(long.as_ref()).len() <= 255 && is_part(Path::new(&hidden(long.as_ref()))));
    }

    #[test]
    fn what_a_dead_process_left_is_swept_and_what_a_live_one_writes_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let [dead, alive, own] =
            [".a.exr.0123456789abcdef-0.part", ".b.exr.0123456789abcdef-1.part", ".c.part"].map(path);
        for file in [&dead, &alive, &own] {
            fs::write(file, "begun").unwrap();
        }
        let held = OpenOptions::new().write(true).open(&alive).unwrap();
        held.try_lock().unwrap();
        let (part, _file) = Part::create(&path("new.exr"), "new.exr".as_ref()).unwrap();
        assert!(!dead.exists() && alive.exists() && own.exists() && part.0.exists());
        assert!(!remove_if_left(&part.0), "this process has it");
        drop(held);
        assert!(remove_if_left(&alive));
        let name = part.0.clone();
        drop(part);
        assert!(!name.exists());
    }
}
