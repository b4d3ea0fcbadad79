//! A folder that belongs to this process and goes with it. A lock inside says that its owner is alive: the folder of a process
//! that was killed outright is removed by the next one that comes by.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::left::LOCK;
use super::lock::Lock;
use super::part::{forget, remember};
use crate::{Error, Result};

/// It is removed with this value, and by [`abandon`](super::abandon) together with whatever in it was [`remember`]ed.
#[derive(Debug)]
pub struct OwnFolder {
    path: PathBuf,
    lock: Option<Lock>,
}

impl OwnFolder {
    /// A folder that `make` makes, empty, at a place that it names.
    ///
    /// # Errors
    /// What `make` says, and [`Error::Io`] where there can be no lock.
    pub fn create(mut make: impl FnMut() -> Result<PathBuf>) -> Result<Self> {
        loop {
            let path = make()?;
            remember(&path);
            let file = path.join(LOCK);
            remember(&file);
            let begun_anew = match Lock::exclusive(&file) {
                Ok(lock) if file.exists() => return Ok(Self { path, lock: Some(lock) }),
                // another process swept between the folder and its lock
                Ok(_) | Err(Error::Busy { .. }) => Ok(()),
                Err(Error::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(()),
                Err(error) => Err(error),
            };
            forget_all(&path);
            begun_anew?;
        }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the folder the name `target` in one step, if nothing but an empty folder has it.
    ///
    /// # Errors
    /// [`Error::Exists`] if something has it, and the folder stays here; otherwise what the system says.
    pub fn publish(&mut self, target: &Path) -> Result<()> {
        let failed = |e| Error::io(target, "write", e);
        // where open files cannot be moved the lock must be closed first
        self.lock = None;
        fs::remove_file(self.path.join(LOCK)).map_err(failed)?;
        // a folder takes the place of an empty one on Unix; elsewhere that gives way before
        if cfg!(not(unix)) {
            let _ = fs::remove_dir(target);
        }
        match fs::rename(&self.path, target) {
            Ok(()) => {
                forget_all(&self.path);
                Ok(())
            }
            Err(_) if target.symlink_metadata().is_ok() => Err(Error::exists(target)),
            Err(error) => Err(failed(error)),
        }
    }
}

impl Drop for OwnFolder {
    fn drop(&mut self) {
        // where open files cannot be removed it must be closed first
        self.lock = None;
        // gone already if it was published, or if the system empties its folder for temporary files
        let _ = fs::remove_dir_all(&self.path);
        forget_all(&self.path);
    }
}

fn forget_all(path: &Path) {
    forget(&path.join(LOCK));
    forget(path);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_takes_the_place_of_nothing_but_an_empty_folder() {
        let root = tempfile::tempdir().unwrap();
        let make = |name: &str| {
            let path = root.path().join(name);
            fs::create_dir(&path).unwrap();
            let folder = OwnFolder::create(|| Ok(path.clone())).unwrap();
            fs::write(folder.path().join("a.txt"), "new").unwrap();
            folder
        };
        let target = |name: &str| root.path().join(name);
        make("1").publish(&target("fresh")).unwrap();
        assert_eq!(fs::read_dir(target("fresh")).unwrap().count(), 1, "and no lock");
        fs::create_dir(target("empty")).unwrap();
        make("2").publish(&target("empty")).unwrap();
        fs::create_dir(target("full")).unwrap();
        fs::write(target("full").join("a.txt"), "precious").unwrap();
        for taken in ["full", "full/a.txt"] {
            let error = make("3").publish(&target(taken)).unwrap_err();
            assert!(matches!(error, Error::Exists { .. }), "{error}");
            assert!(!target("3").exists(), "what was not published goes");
        }
        assert_eq!(fs::read_to_string(target("full/a.txt")).unwrap(), "precious");
    }
}
