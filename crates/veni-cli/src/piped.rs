//! `-` and pipes in place of files: what comes in is kept in a file of a private folder, since readers go back and
//! forth in it, and what goes out is written there whole before the first byte of it is seen.

use std::fs::{File, Metadata};
use std::io::{self, IsTerminal, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::{Result, anyhow, bail};
use veni_light::Error;
use veni_light::output::{OwnFolder, remember};

use crate::private::private_folder;

/// Most bytes that are taken from a pipe: more than the largest panorama that is read.
const MOST: u64 = 4 << 30;
/// Bytes that are taken at a time.
const BLOCK: usize = 1 << 18;
/// What standard input, or output, is called.
const STANDARD: &str = "-";
/// What it is called in messages and in the names of outputs.
const STDIN: &str = "stdin";
/// Other names of standard input.
const ALSO_STDIN: [&str; 3] = ["/dev/stdin", "/dev/fd/0", "/proc/self/fd/0"];

/// What is in the private folder.
static HERE: Mutex<Here> = Mutex::new(Here { folder: None, files: Vec::new(), output: None });

struct Here {
    folder: Option<OwnFolder>,
    /// Copies, and what the user called their sources.
    files: Vec<(PathBuf, PathBuf)>,
    /// What is to go to standard output.
    output: Option<PathBuf>,
}

/// Whether `path` stands for standard input or output.
pub(crate) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD
}

/// The names by which outputs and messages call inputs.
pub(crate) fn names(inputs: &[PathBuf]) -> Vec<PathBuf> {
    inputs.iter().map(|path| if is_standard(path) { PathBuf::from(STDIN) } else { path.clone() }).collect()
}

/// What the user called the file at `path`.
pub(crate) fn name(path: &Path) -> PathBuf {
    let here = here();
    let found = here.files.iter().find(|(copy, _)| copy == path);
    found.map_or_else(|| path.to_path_buf(), |(_, name)| name.clone())
}

/// Files that can be read as often as one likes, in the order of `inputs`.
pub(crate) fn inputs(inputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
    inputs.iter().map(|path| input(path)).collect()
}

/// The same of one.
pub(crate) fn input(path: &Path) -> Result<PathBuf> {
    if is_standard(path) {
        return keep(io::stdin().lock(), Path::new(STDIN));
    }
    // what is not there, or is a folder, is reported by whoever reads it
    match path.metadata() {
        Ok(meta) if is_device(&meta) && !is_same(path, Path::new(STDIN)) => {
            bail!("{}: is a device, not a file; name a file, or a pipe", path.display())
        }
        Ok(meta) if !meta.is_file() && !meta.is_dir() => {
            let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
            keep(file, path)
        }
        _ => Ok(path.to_path_buf()),
    }
}

/// The same of one that may not be given.
pub(crate) fn input_if(path: Option<&Path>) -> Result<Option<PathBuf>> {
    path.map(input).transpose()
}

/// Where a file is written that may be `-`: then to one with this extension that [`deliver`] gives to standard output.
pub(crate) fn output(path: &Path, extension: &str) -> Result<PathBuf> {
    if !is_standard(path) {
        return Ok(path.to_path_buf());
    }
    if io::stdout().is_terminal() {
        bail!("-: standard output is a terminal; redirect it (> out.{extension}), or name a file");
    }
    let path = folder()?.join(format!("stdout.{extension}"));
    remember(&path);
    let mut here = here();
    here.files.push((path.clone(), PathBuf::from(STANDARD)));
    here.output = Some(path.clone());
    Ok(path)
}

/// The same of one that may not be given.
pub(crate) fn output_if(path: Option<&Path>, extension: &str) -> Result<Option<PathBuf>> {
    path.map(|path| output(path, extension)).transpose()
}

/// Gives to `write`, which knows standard output, what was written for it, if it was.
pub(crate) fn deliver(mut write: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
    let Some(path) = here().output.take() else { return Ok(()) };
    let failed = |e| Error::io(&path, "read", e);
    let mut file = match File::open(&path) {
        Ok(file) => file,
        // the command failed before it
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(failed(e).into()),
    };
    let mut block = vec![0; BLOCK];
    loop {
        match file.read(&mut block) {
            Ok(0) => return Ok(()),
            Ok(count) => write(&block[..count])?,
            Err(e) => return Err(failed(e).into()),
        }
    }
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
    here().folder = None;
}

fn keep(mut from: impl Read, name: &Path) -> Result<PathBuf> {
    let shown = name.display();
    if here().files.iter().any(|(_, known)| is_same(known, name)) {
        bail!(
            "{shown}: a pipe can be read only once, and was read already; save it as a file, and name that"
        );
    }
    let folder = folder()?;
    let own = name.file_name().unwrap_or_default().to_string_lossy();
    let path = folder.join(format!("{}-{own}", here().files.len()));
    let mut file = File::create_new(&path).map_err(|e| Error::io(&path, "create", e))?;
    remember(&path);
    let (mut block, mut bytes) = (vec![0; BLOCK], 0);
    loop {
        let count = match from.read(&mut block) {
            Ok(0) => break,
            Ok(count) => count,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(Error::io(name, "read", e).into()),
        };
        bytes += count as u64;
        if bytes > MOST {
            bail!("{shown}: more than {} GiB come from this pipe; save it as a file first", MOST >> 30);
        }
        file.write_all(&block[..count]).map_err(|e| {
            let temporary = std::env::temp_dir();
            anyhow!(
                "{shown}: what comes from this pipe cannot be kept in {} ({e}); free some space there, or name another \
                 folder by the environment variable TMPDIR",
                temporary.display()
            )
        })?;
    }
    here().files.push((path.clone(), name.to_path_buf()));
    Ok(path)
}

/// Whether it is a device, which may have no end: gigabytes would be kept of it.
#[cfg(unix)]
fn is_device(meta: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    meta.file_type().is_char_device() || meta.file_type().is_block_device()
}

/// There are none with a path elsewhere.
#[cfg(not(unix))]
fn is_device(_: &Metadata) -> bool {
    false
}

/// Whether two names are of one pipe.
fn is_same(a: &Path, b: &Path) -> bool {
    let is_stdin =
        |path: &Path| path == Path::new(STDIN) || ALSO_STDIN.iter().any(|also| path == Path::new(also));
    a == b || is_stdin(a) && is_stdin(b)
}

fn folder() -> Result<PathBuf> {
    let mut here = here();
    let folder = match here.folder.take() {
        Some(folder) => folder,
        None => private_folder()?,
    };
    Ok(here.folder.insert(folder).path().to_path_buf())
}

fn here() -> MutexGuard<'static, Here> {
    HERE.lock().unwrap_or_else(PoisonError::into_inner)
}
