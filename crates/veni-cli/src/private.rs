//! The private folder of this process among the system's temporary files. A lock inside says that its owner is alive: the
//! folder of a process that was killed outright is removed by the next one.

use std::fs;
use std::path::Path;

use anyhow::Result;
use veni_light::Error;
use veni_light::output::{OwnFolder, remove_folder_if_left};

/// What such folders are called.
const PREFIX: &str = ".veni-cli-";
const SUFFIX: &str = ".pipes";

/// A new, empty one, which nobody else may look into.
pub(crate) fn private_folder() -> Result<OwnFolder> {
    let folder = OwnFolder::create(|| {
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o700));
        }
        let made = builder.tempdir();
        Ok(made.map_err(|e| Error::io(std::env::temp_dir(), "create a file in", e))?.keep())
    });
    Ok(folder?)
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
            remove_folder_if_left(&path);
        }
    }
}

fn is_private(name: &str) -> bool {
    name.len() > PREFIX.len() + SUFFIX.len() && name.starts_with(PREFIX) && name.ends_with(SUFFIX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::output::Lock;

    const LOCK: &str = "lock";

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
        let folder = private_folder().unwrap();
        let path = folder.path().to_path_buf();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o700);
        }
        remove_folder_if_left(&path);
        assert!(path.exists(), "its owner is alive");
        fs::write(path.join("file"), "").unwrap();
        drop(folder);
        assert!(!path.exists());
    }
}
