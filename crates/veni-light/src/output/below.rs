//! Names that come out of files: they may lead nowhere but below the folder they belong to.

use std::io;
use std::path::{Component, Path, PathBuf};

use crate::{Error, Result};

/// The path of `name`, which was read from a file, below `folder`, to which that file belongs. Whatever is written, moved
/// or removed by a name out of a file goes through here: a folder may come from somebody else.
///
/// # Errors
/// [`Error::Invalid`] if it is empty, absolute, has a `..` in it, or leads through a symbolic link, which `name` itself
/// must not be either (`folder` may); [`Error::Io`] if that cannot be found out.
pub fn below(folder: &Path, name: impl AsRef<Path>) -> Result<PathBuf> {
    let name = name.as_ref();
    let refused = |why: &str| {
        let name = name.display();
        Error::invalid(format!("names {name}, {why}: nothing outside the folder is touched")).in_file(folder)
    };
    if name.as_os_str().is_empty() {
        return Err(refused("which is not a file"));
    }
    let mut path = folder.to_path_buf();
    for component in name.components() {
        let Component::Normal(part) = component else {
            return Err(refused("which is not below it"));
        };
        path.push(part);
        match path.symlink_metadata() {
            Ok(meta) if meta.is_symlink() => {
                return Err(refused(&format!("and {} is a symbolic link", path.display())));
            }
            Ok(_) => {}
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(Error::io(&path, "look at", e)),
        }
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_below_their_folder() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("set");
        std::fs::create_dir_all(folder.join("train")).unwrap();
        std::fs::write(outer.path().join("victim.txt"), "precious").unwrap();
        assert_eq!(below(&folder, "train/a.exr").unwrap(), folder.join("train/a.exr"));
        assert_eq!(below(&folder, "new/deep/a.exr").unwrap(), folder.join("new/deep/a.exr"));
        let absolute = outer.path().join("victim.txt");
        for name in
            ["../victim.txt", "train/../../victim.txt", "..", "", ".", "/", absolute.to_str().unwrap()]
        {
            let message = below(&folder, name).unwrap_err().to_string();
            assert!(message.contains(name) && message.contains("set: names"), "{name}: {message}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(outer.path(), folder.join("link")).unwrap();
            std::os::unix::fs::symlink(&absolute, folder.join("train/b.exr")).unwrap();
            for name in ["link/victim.txt", "link", "train/b.exr"] {
                let message = below(&folder, name).unwrap_err().to_string();
                assert!(message.contains("symbolic link"), "{name}: {message}");
            }
            // the folder itself is where its user put it
            let linked = outer.path().join("linked");
            std::os::unix::fs::symlink(&folder, &linked).unwrap();
            assert!(below(&linked, "train/a.exr").is_ok());
        }
    }
}
