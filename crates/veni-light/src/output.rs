//! Writing files so that nothing is ever lost: beside the target, synced, then given its name in one step.

mod below;
mod left;
mod lock;
mod own_folder;
mod part;

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::{Error, Result};
use part::Part;

pub use below::below;
pub use left::{remove_folder_if_left, remove_if_left};
pub use lock::Lock;
pub use own_folder::OwnFolder;
pub use part::{Abandoned, abandon, forget, is_part, part_beside, process_token, remember};

/// Whether an existing file may be replaced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overwrite {
    /// Refuse with [`Error::Exists`]; nothing is touched, whenever it came into being. The default.
    #[default]
    Refuse,
    /// Replace it once the new content is complete, with its permissions. Of a symbolic link the link is replaced: what
    /// it points to stays as it is.
    Replace,
}

/// Calls `write` with a new file beside `path`, syncs it and gives it the name `path`.
///
/// # Errors
/// [`Error::Exists`] if `path` exists and may not be replaced, be it that another process made it meanwhile;
/// [`Error::Invalid`] if it is a folder, a device or a pipe; otherwise what `write` or the system says.
/// After any error the new file is removed and a previous file at `path` is as it was.
pub fn write_atomic(
    path: &Path,
    overwrite: Overwrite,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<()>,
) -> Result<()> {
    refuse_existing(path, overwrite)?;
    let name =
        path.file_name().ok_or_else(|| Error::invalid("is not a file name to write to").in_file(path))?;
    let (part, file) = Part::create(path, name).map_err(|e| Error::io(path, "create", e))?;
    let mut file = BufWriter::new(file);
    let failed = |e| Error::io(path, "write", e);
    write(&mut file)?;
    file.flush().map_err(failed)?;
    if overwrite == Overwrite::Replace {
        keep_permissions(path, file.get_ref()).map_err(failed)?;
    }
    file.get_ref().sync_all().map_err(failed)?;
    part.finish(|part| match overwrite {
        Overwrite::Replace => fs::rename(part, path),
        Overwrite::Refuse => name_new(part, path),
    })
    .map_err(|e| match e.kind() {
        io::ErrorKind::AlreadyExists => Error::exists(path),
        _ => failed(e),
    })
}

/// The check of [`write_atomic`] alone, for commands that should refuse before a long computation.
///
/// # Errors
/// [`Error::Exists`] if `path` exists and `overwrite` is [`Overwrite::Refuse`]; [`Error::Invalid`] if it is something that
/// no file can replace.
pub fn refuse_existing(path: &Path, overwrite: Overwrite) -> Result<()> {
    match (path.symlink_metadata(), overwrite) {
        (Ok(_), Overwrite::Refuse) => Err(Error::exists(path)),
        (Ok(meta), Overwrite::Replace) if !meta.is_file() && !meta.is_symlink() => {
            let what = if meta.is_dir() { "a folder" } else { "a device or a pipe" };
            Err(Error::invalid(format!("is {what}, which no file replaces; name a file")).in_file(path))
        }
        _ => Ok(()),
    }
}

/// The nearest folder above `path` that exists; of a relative path, at last the working folder.
pub fn existing_above(path: &Path) -> &Path {
    // the last ancestor of a relative path is empty
    path.ancestors().skip(1).find(|above| above.exists()).unwrap_or(Path::new("."))
}

/// Moves a file to a name that nothing has; to the file system that is one step.
///
/// # Errors
/// Of the kind `AlreadyExists` if something has it; otherwise what the system says.
pub fn name_new(from: &Path, to: &Path) -> io::Result<()> {
    match fs::hard_link(from, to) {
        Ok(()) => fs::remove_file(from),
        Err(e) if matches!(e.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::NotFound) => Err(e),
        // no second names in this file system: the name is taken first, by an empty file
        Err(_) => {
            OpenOptions::new().write(true).create_new(true).open(to)?;
            fs::rename(from, to).inspect_err(|_| {
                let _ = fs::remove_file(to);
            })
        }
    }
}

/// Gives a file the mode bits of the one that it is to replace.
#[cfg(unix)]
fn keep_permissions(replaced: &Path, file: &File) -> io::Result<()> {
    match replaced.symlink_metadata() {
        Ok(meta) if meta.is_file() => file.set_permissions(meta.permissions()),
        _ => Ok(()),
    }
}

/// Elsewhere permissions are those of the folder.
#[cfg(not(unix))]
fn keep_permissions(_: &Path, _: &File) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(path: &Path, overwrite: Overwrite, text: &str, meanwhile: impl FnOnce()) -> Result<()> {
        write_atomic(path, overwrite, |file| {
            meanwhile();
            file.write_all(text.as_bytes()).map_err(|e| Error::io(path, "write", e))
        })
    }

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn what_came_meanwhile_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("late.txt");
        let late = write(&path, Overwrite::Refuse, "new", || fs::write(&path, "precious").unwrap());
        assert!(matches!(late, Err(Error::Exists { .. })), "{late:?}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
        assert_eq!(names(folder.path()), ["late.txt"]);
        write(&path, Overwrite::Replace, "new", || ()).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    }

    #[test]
    fn of_many_writers_one_wins() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.txt");
        let barrier = std::sync::Barrier::new(8);
        let won: usize = std::thread::scope(|scope| {
            let one = |k: usize| {
                let (path, barrier) = (&path, &barrier);
                scope.spawn(move || {
                    let wrote = write(path, Overwrite::Refuse, &k.to_string(), || {
                        barrier.wait();
                    });
                    usize::from(wrote.is_ok())
                })
            };
            let threads: Vec<_> = (0..8).map(one).collect();
            threads.into_iter().map(|t| t.join().unwrap()).sum()
        });
        assert_eq!((won, names(folder.path())), (1, vec!["one.txt".to_owned()]));
    }

    #[test]
    fn a_failure_or_a_panic_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let failed = write_atomic(&path, Overwrite::Refuse, |_| Err(Error::invalid("no")));
        assert!(failed.is_err());
        let thread = std::thread::spawn(move || write(&path, Overwrite::Refuse, "", || panic!("on purpose")));
        assert!(thread.join().is_err());
        assert_eq!(names(folder.path()), Vec::<String>::new());
    }

    #[cfg(unix)]
    #[test]
    fn a_replaced_file_keeps_its_mode_and_a_link_is_replaced_itself() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let [path, link] = ["a.txt", "link.txt"].map(|name| folder.path().join(name));
        write(&path, Overwrite::Refuse, "old", || ()).unwrap();
        let mode = |path: &Path| path.symlink_metadata().unwrap().permissions().mode() & 0o7777;
        for bits in [0o640, 0o444] {
            fs::set_permissions(&path, fs::Permissions::from_mode(bits)).unwrap();
            write(&path, Overwrite::Replace, "new", || ()).unwrap();
            assert_eq!(mode(&path), bits);
        }
        symlink(&path, &link).unwrap();
        assert!(matches!(write(&link, Overwrite::Refuse, "x", || ()), Err(Error::Exists { .. })));
        write(&link, Overwrite::Replace, "other", || ()).unwrap();
        assert!(!link.is_symlink());
        let read = |path: &Path| fs::read_to_string(path).unwrap();
        assert_eq!((read(&link).as_str(), read(&path).as_str()), ("other", "new"));
        let message = write(folder.path(), Overwrite::Replace, "x", || ()).unwrap_err().to_string();
        assert!(message.contains("is a folder"), "{message}");
        let device = write(Path::new("/dev/null"), Overwrite::Replace, "x", || ()).unwrap_err().to_string();
        assert!(device.contains("a device"), "{device}");
    }
}
