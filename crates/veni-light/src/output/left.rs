//! What a process that was killed outright left behind: nobody holds its lock any more.

use std::fs::{self, OpenOptions};
use std::path::Path;

use super::lock::Lock;

/// The file in a folder of one process that is locked while that lives.
pub(super) const LOCK: &str = "lock";

/// Removes an unfinished file unless its owner may be alive. Whether it is gone.
pub fn remove_if_left(path: &Path) -> bool {
    if !path.symlink_metadata().is_ok_and(|meta| meta.is_file()) {
        return false;
    }
    let Ok(file) = OpenOptions::new().write(true).open(path) else { return false };
    // the lock is held until the name is gone
    file.try_lock().is_ok() && fs::remove_file(path).is_ok()
}

/// Removes a folder of one process ([`OwnFolder`](super::OwnFolder)) unless that may be alive.
pub fn remove_folder_if_left(path: &Path) {
    let file = path.join(LOCK);
    if !file.symlink_metadata().is_ok_and(|meta| meta.is_file()) {
        // its owner may be about to lock it, and begins anew if it is gone; or about to publish it, and it is not empty
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_the_dead_go_and_those_of_the_living_and_of_users_stay() {
        let root = tempfile::tempdir().unwrap();
        let path = |name: &str| root.path().join(name);
        for (name, file) in [("alive", LOCK), ("dead", LOCK), ("own", "my.exr")] {
            fs::create_dir(path(name)).unwrap();
            fs::write(path(name).join(file), "").unwrap();
        }
        fs::write(path("dead/half.exr"), "").unwrap();
        let _held = Lock::exclusive(&path("alive").join(LOCK)).unwrap();
        for name in ["alive", "dead", "own"] {
            remove_folder_if_left(&path(name));
        }
        assert!(path("alive").exists() && path("own").exists() && !path("dead").exists());
    }
}
