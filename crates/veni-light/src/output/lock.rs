//! One process at a time: a locked file in the folder that processes would share.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// A lock on a folder, as long as this value lives; the system frees that of a process that was killed.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    held: bool,
    exclusive: bool,
    file: File,
}

impl Lock {
    /// For this process alone. `path` is the file to lock, which is made and stays.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process has it; [`Error::Io`] if there can be no such file.
    pub fn exclusive(path: &Path) -> Result<Self> {
        let mut lock = Self::take(path, File::try_lock)?;
        if lock.held {
            // for whoever meets the lock; who that is does not depend on it
            lock.exclusive = true;
            let file = &mut lock.file;
            let _ = file.set_len(0).and_then(|()| writeln!(file, "process {}", std::process::id()));
        }
        Ok(lock)
    }

    /// For this process and others that share it.
    ///
    /// # Errors
    /// As [`Lock::exclusive`].
    pub fn shared(path: &Path) -> Result<Self> {
        Self::take(path, File::try_lock_shared)
    }

    /// Whether the file system has locks: if not, nothing keeps others away.
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn take(path: &Path, lock: impl Fn(&File) -> Result<(), TryLockError>) -> Result<Self> {
        // a link would have a file elsewhere emptied
        if path.is_symlink() {
            let link = Error::invalid("is a symbolic link, where a lock should be; remove it");
            return Err(link.in_file(path));
        }
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = file.map_err(|e| Error::io(path, "create", e))?;
        let held = match lock(&file) {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => {
                let mut owner = String::new();
                let read = file.rewind().and_then(|()| (&mut file).take(100).read_to_string(&mut owner));
                let owner = read.ok().map(|_| owner.trim().to_owned()).filter(|owner| !owner.is_empty());
                return Err(Error::Busy { path: path.to_path_buf(), owner });
            }
            Err(TryLockError::Error(_)) => false,
        };
        Ok(Self { path: path.to_path_buf(), held, exclusive: false, file })
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        if self.exclusive {
            // what is said of the owner goes with it
            let _ = self.file.set_len(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_for_one_or_for_those_who_share() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(".lock");
        let busy = |lock: Result<Lock>| matches!(lock, Err(Error::Busy { .. }));
        let first = Lock::exclusive(&path).unwrap();
        assert!(first.is_held());
        let message = Lock::exclusive(&path).unwrap_err().to_string();
        assert!(message.contains(&std::process::id().to_string()), "{message}");
        assert!(busy(Lock::shared(&path)));
        drop(first);
        assert_eq!(path.metadata().unwrap().len(), 0);
        let shared = [Lock::shared(&path).unwrap(), Lock::shared(&path).unwrap()];
        assert!(busy(Lock::exclusive(&path)));
        drop(shared);
        Lock::exclusive(&path).unwrap();
    }
}
