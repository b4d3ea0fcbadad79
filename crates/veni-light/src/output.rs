//! Writing files so that nothing is ever lost: beside the target, synced, then renamed over it.

use std::fs::{self, File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Whether an existing file may be replaced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overwrite {
    /// Refuse with [`Error::Exists`]; nothing is touched. The default.
    #[default]
    Refuse,
    /// Replace it once the new content is complete.
    Replace,
}

/// Calls `write` with a new file beside `path`, syncs it and renames it to `path`.
///
/// # Errors
/// [`Error::Exists`] if `path` exists and may not be replaced; otherwise what `write` or the system says.
/// After any error the new file is removed and a previous file at `path` is as it was.
pub fn write_atomic(
    path: &Path,
    overwrite: Overwrite,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<()>,
) -> Result<()> {
    refuse_existing(path, overwrite)?;
    let beside = beside(path)?;
    let result = (|| {
        let file = OpenOptions::new().write(true).create_new(true).open(&beside);
        let mut file = BufWriter::new(file.map_err(|e| Error::io(path, "create", e))?);
        write(&mut file)?;
        file.flush().map_err(|e| Error::io(path, "write", e))?;
        file.get_ref().sync_all().map_err(|e| Error::io(path, "write", e))?;
        fs::rename(&beside, path).map_err(|e| Error::io(path, "write", e))
    })();
    if result.is_err() {
        // best effort: the error already on its way says more than a failed clean-up would
        let _ = fs::remove_file(&beside);
    }
    result
}

/// The check of [`write_atomic`] alone, for commands that should refuse before a long computation.
///
/// # Errors
/// [`Error::Exists`] if `path` exists and `overwrite` is [`Overwrite::Refuse`].
pub fn refuse_existing(path: &Path, overwrite: Overwrite) -> Result<()> {
    if overwrite == Overwrite::Refuse && path.symlink_metadata().is_ok() {
        return Err(Error::exists(path));
    }
    Ok(())
}

/// The nearest folder above `path` that exists; of a relative path, at last the working folder.
pub fn existing_above(path: &Path) -> &Path {
    // the last ancestor of a relative path is empty
    path.ancestors().skip(1).find(|above| above.exists()).unwrap_or(Path::new("."))
}

/// Whether this is the unfinished file of a [`write_atomic`], by its name.
pub fn is_part(path: &Path) -> bool {
    let hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    hidden && path.extension().is_some_and(|e| e == "part")
}

/// A number that no other process is likely to have: process numbers repeat from machine to machine, and several may
/// write to one file system.
pub fn process_token() -> u64 {
    use std::hash::{BuildHasher, RandomState};
    static TOKEN: std::sync::OnceLock<u64> = std::sync::OnceLock::new();
    *TOKEN.get_or_init(|| RandomState::new().hash_one(std::process::id()))
}

fn beside(path: &Path) -> Result<PathBuf> {
    use std::sync::atomic::{AtomicU64, Ordering};
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| Error::invalid(format!("{}: is not a file name to write to", path.display())))?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{:016x}-{}.part", process_token(), COUNT.fetch_add(1, Ordering::Relaxed)));
    Ok(path.with_file_name(hidden))
}
