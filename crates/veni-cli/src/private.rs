//! The private folder of this process among the system's temporary files. A lock inside says that its owner is alive: the
//! folder of a process that was killed outright is removed by the next one.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::Result;
use veni_light::Error;
use veni_light::output::{Lock, forget, remember};

/// What such folders are called.
const PREFIX: &str = ".veni-cli-";
const SUFFIX: &str = ".pipes";
/// The file inside that is locked.
const LOCK: &str = "lock";

/// It goes with this value, and on a signal with whatever in it was [`remember`]ed.
pub(crate) struct PrivateFolder {
    path: PathBuf,
    lock: Option<Lock>,
}

impl PrivateFolder {
    /// A new, empty one, which nobody else may look into.
    pub(crate) fn new() -> Result<Self> {
        loop {
            let mut builder = tempfile::Builder::new();
            builder.prefix(PREFIX).suffix(SUFFIX);
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt;
                builder.permissions(fs::Permissions::from_mode(0o700));
            }
            let made = builder.tempdir();
            let failed = |e| Error::io(std::env::temp_dir(), "create a file in", e);
            let path = made.map_err(failed)?.keep();
            remember(&path);
            let file = path.join(LOCK);
            remember(&file);
            match Lock::exclusive(&file) {
                Ok(lock) if file.exists() => return Ok(Self { path, lock: Some(lock) }),
                // another process swept between the folder and its lock
                Ok(_) | Err(Error::Busy { .. }) => forget_all(&[&file, &path]),
                Err(Error::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
                    forget_all(&[&file, &path]);
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for PrivateFolder {
    fn drop(&mut self) {
        // where open files cannot be removed it must be closed first
        self.lock = None;
        // the system empties its folder for temporary files now and then
        let _ = fs::remove_dir_all(&self.path);
        forget_all(&[&self.path.join(LOCK), &self.path]);
    }
}

/// Removes the folders of processes that are no more.
pub(crate) fn sweep() {
    sweep_in(&std::env::temp_dir());
}

fn sweep_in(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|entry| is_private(&entry.file_name().to_string_lossy())) {
        let path = entry.path();
        // never through a link: the folder for temporary files is everybody's
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            remove_if_left(&path);
        }
    }
}

fn is_private(name: &str) -> bool {
    name.len() > PREFIX.len() + SUFFIX.len() && name.starts_with(PREFIX) && name.ends_with(SUFFIX)
}

fn remove_if_left(path: &Path) {
    let file = path.join(LOCK);
    if !file.symlink_metadata().is_ok_and(|meta| meta.is_file()) {
        // its owner may be about to lock it, and begins anew if it is gone
        let _ = fs::remove_dir(path);
        return;
    }
    match Lock::exclusive(&file) {
        // without locks nobody knows who is alive
        Ok(lock) if lock.is_held() => {
            let _ = fs::remove_dir_all(path);
        }
        _ => {}
    }
}

fn forget_all(paths: &[&Path]) {
    paths.iter().for_each(|path| forget(path));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_the_dead_are_removed_and_no_others() {
        let temporary = tempfile::tempdir().unwrap();
        let path = |name: &str| temporary.path().join(name);
        let [dead, empty, living] =
            ["dead", "empty", "living"].map(|name| path(&format!("{PREFIX}{name}{SUFFIX}")));
        let [own, other] = [path("veni-cli.pipes"), path(".veni-cli-notes")];
        for folder in [&dead, &empty, &living, &own, &other] {
            fs::create_dir(folder).unwrap();
        }
        for file in [dead.join(LOCK), dead.join("0-stdin"), own.join(LOCK), other.join(LOCK)] {
            fs::write(file, "").unwrap();
        }
        let lock = Lock::exclusive(&living.join(LOCK)).unwrap();
        sweep_in(temporary.path());
        assert!(!dead.exists() && !empty.exists());
        assert!(living.exists() && own.exists() && other.join(LOCK).exists());
        drop(lock);
        sweep_in(temporary.path());
        assert!(!living.exists());
    }

    #[cfg(unix)]
    #[test]
    fn no_link_is_followed() {
        let temporary = tempfile::tempdir().unwrap();
        let precious = temporary.path().join("precious");
        fs::create_dir(&precious).unwrap();
        fs::write(precious.join(LOCK), "mine").unwrap();
        let link = temporary.path().join(format!("{PREFIX}link{SUFFIX}"));
        std::os::unix::fs::symlink(&precious, &link).unwrap();
        sweep_in(temporary.path());
        assert_eq!(fs::read_to_string(precious.join(LOCK)).unwrap(), "mine");
    }

    #[test]
    fn it_is_private_and_goes() {
        let folder = PrivateFolder::new().unwrap();
        let path = folder.path().to_path_buf();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o700);
        }
        remove_if_left(&path);
        assert!(path.exists(), "its owner is alive");
        fs::write(path.join("file"), "").unwrap();
        drop(folder);
        assert!(!path.exists());
    }
}
