//! `-`, pipes and devices in place of files: what comes in is kept in a file of a private folder, since readers go back and
//! forth in it, and what goes out is written there whole before the first byte of it is seen.

use std::fs::{self, File};
use std::io::{self, IsTerminal, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Result, bail};
use veni_light::Error;
use veni_light::output::{forget, remember};

/// Most bytes that are taken from a pipe: more than the largest panorama that is read.
const MOST: u64 = 4 << 30;
/// What standard input, or output, is called.
const STANDARD: &str = "-";
/// What it is called in messages and in the names of outputs.
const STDIN: &str = "stdin";

/// What is in the private folder.
static HERE: Mutex<Here> = Mutex::new(Here { folder: None, files: Vec::new() });

struct Here {
    folder: Option<PathBuf>,
    /// Copies, and what the user called their sources.
    files: Vec<(PathBuf, PathBuf)>,
}

/// Whether `path` stands for standard output.
pub(crate) fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == STANDARD
}

/// The names by which outputs and messages call inputs.
pub(crate) fn names(inputs: &[PathBuf]) -> Vec<PathBuf> {
    inputs.iter().map(|path| if is_stdout(path) { PathBuf::from(STDIN) } else { path.clone() }).collect()
}

/// What the user called the file at `path`.
pub(crate) fn name(path: &Path) -> PathBuf {
    let here = here();
    let found = here.files.iter().find(|(copy, _)| copy == path);
    found.map_or_else(|| path.to_path_buf(), |(_, name)| name.clone())
}

/// Files that can be read as often as one likes, in the order of `inputs`.
pub(crate) fn inputs(inputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if inputs.iter().filter(|path| is_stdout(path)).count() > 1 {
        bail!("-: standard input can be read only once; name it once");
    }
    inputs.iter().map(|path| input(path)).collect()
}

/// The same of one.
pub(crate) fn input(path: &Path) -> Result<PathBuf> {
    if is_stdout(path) {
        return keep(io::stdin().lock(), Path::new(STDIN));
    }
    // what is not there, or is a folder, is reported by whoever reads it
    match path.metadata() {
        Ok(meta) if !meta.is_file() && !meta.is_dir() => {
            let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
            keep(file, path)
        }
        _ => Ok(path.to_path_buf()),
    }
}

/// The bytes of a file that `write` makes, by a name with this extension: for standard output.
pub(crate) fn output(extension: &str, write: impl FnOnce(&Path) -> Result<()>) -> Result<Vec<u8>> {
    let path = folder()?.join(format!("stdout.{extension}"));
    here().files.push((path.clone(), PathBuf::from(STANDARD)));
    write(&path)?;
    Ok(fs::read(&path).map_err(|e| Error::io(&path, "read", e))?)
}

/// Refuses to write an image where a person would see its bytes.
pub(crate) fn check_stdout() -> Result<()> {
    if io::stdout().is_terminal() {
        bail!("-: standard output is a terminal; redirect it (> sky.exr), or name a file");
    }
    Ok(())
}

/// Messages and results call copies by the names of their sources.
pub(crate) fn renamed(message: String) -> String {
    let here = here();
    here.files
        .iter()
        .fold(message, |text, (copy, name)| text.replace(&*copy.to_string_lossy(), &name.to_string_lossy()))
}

/// Removes the private folder.
pub(crate) fn clear() {
    if let Some(folder) = here().folder.take() {
        // it is the system's folder for temporary files, which is emptied now and then
        let _ = fs::remove_dir_all(&folder);
        forget(&folder);
    }
}

fn keep(mut from: impl Read, name: &Path) -> Result<PathBuf> {
    let folder = folder()?;
    let own = name.file_name().unwrap_or_default().to_string_lossy();
    let path = folder.join(format!("{}-{own}", here().files.len()));
    let mut file = File::create_new(&path).map_err(|e| Error::io(&path, "create", e))?;
    remember(&path);
    let copied = io::copy(&mut from.by_ref().take(MOST + 1), &mut file);
    let bytes = copied.map_err(|e| Error::io(name, "read", e))?;
    if bytes > MOST {
        let name = name.display();
        bail!("{name}: more than {} GiB come from this pipe; save it as a file first", MOST >> 30);
    }
    here().files.push((path.clone(), name.to_path_buf()));
    Ok(path)
}

fn folder() -> Result<PathBuf> {
    let mut here = here();
    if let Some(folder) = &here.folder {
        return Ok(folder.clone());
    }
    let made = tempfile::Builder::new().prefix("veni-").tempdir();
    let folder = made.map_err(|e| Error::io(std::env::temp_dir(), "create a file in", e))?.keep();
    remember(&folder);
    here.folder = Some(folder.clone());
    Ok(folder)
}

fn here() -> std::sync::MutexGuard<'static, Here> {
    HERE.lock().unwrap_or_else(PoisonError::into_inner)
}
