//! Which files are candidates, and what their folders say about the split.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use anyhow::{Result, bail};
use veni_data::prepare::Split;
use veni_light::Error;
use walkdir::WalkDir;

/// Names that promise an image; whether it can be read is another question.
const EXTENSIONS: [&str; 18] = [
    "exr", "hdr", "pic", "rgbe", "xyze", "png", "jpg", "jpeg", "jpe", "webp", "avif", "heic", "heif", "tif",
    "tiff", "bmp", "gif", "jxl",
];

/// First bytes of images, for files whose names promise nothing.
const MAGIC: [&[u8]; 5] = [b"\x76\x2f\x31\x01", b"#?RADIANCE", b"#?RGBE", b"\x89PNG\r\n", b"\xFF\xD8\xFF"];

/// A file that may be a panorama.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Source {
    /// As the user would name it.
    pub(super) path: PathBuf,
    /// Its one true name.
    pub(super) key: String,
    pub(super) bytes: u64,
    /// Nanoseconds since 1970.
    pub(super) modified: u64,
    /// The side that a folder's name gives it.
    pub(super) given: Option<Split>,
}

/// What was found.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// In the order of their paths, each once.
    pub(super) sources: Vec<Source>,
    /// Files that are not images.
    pub(super) ignored: Vec<PathBuf>,
    /// What could not be looked at, and why: it costs itself alone.
    pub(super) unreadable: Vec<(PathBuf, String)>,
}

/// Searches the inputs to the bottom, except the output folder; links to folders are followed.
pub(super) fn scan(inputs: &[PathBuf], output: &Path) -> Result<Found> {
    let output = output.canonicalize().ok();
    let mut found = Found::default();
    let mut seen = BTreeSet::new();
    let inside =
        |path: &Path| output.as_deref().is_some_and(|o| path.canonicalize().is_ok_and(|p| p.starts_with(o)));
    for input in inputs {
        if !input.exists() {
            bail!("{}: there is no such file or folder", input.display());
        }
        if inside(input) {
            bail!(
                "{}: is in the folder that is to be filled, where sources would be replaced; name another folder with -o",
                input.display()
            );
        }
        let entries = WalkDir::new(input).follow_links(true).sort_by_file_name().into_iter();
        for entry in entries.filter_entry(|e| !(e.file_type().is_dir() && inside(e.path()))) {
            let entry = match entry {
                Ok(entry) => entry,
                Err(error) => {
                    let (path, reason) = unreadable(input, &error);
                    // such as the locks of editors, which are links to nowhere
                    if is_hidden(&path) && path != *input {
                        found.ignored.push(path);
                    } else {
                        found.unreadable.push((path, reason));
                    }
                    continue;
                }
            };
            if entry.file_type().is_dir() {
                continue;
            }
            let is_file = entry.file_type().is_file();
            let path = entry.into_path();
            // a file that was named is meant
            if path != *input && !(is_file && is_image(&path)) {
                found.ignored.push(path);
                continue;
            }
            if !is_file {
                // opening a pipe would wait for whoever writes into it
                found.unreadable.push((path, "is a device or a pipe; save it as a file first".to_owned()));
                continue;
            }
            match source(input, path.clone()) {
                Ok(source) if seen.insert(source.key.clone()) => found.sources.push(source),
                Ok(_) => {}
                Err(error) => found.unreadable.push((path, error.with_source())),
            }
        }
    }
    found.sources.sort_by(|a, b| a.path.cmp(&b.path));
    found.ignored.sort();
    found.ignored.dedup();
    found.unreadable.sort();
    found.unreadable.dedup();
    Ok(found)
}

/// An entry that could not be looked at: its path, and why.
fn unreadable(input: &Path, error: &walkdir::Error) -> (PathBuf, String) {
    let path = error.path().unwrap_or(input).to_path_buf();
    let reason = match (error.loop_ancestor(), error.io_error()) {
        (Some(above), _) => format!("is a link to {}, which it is in", above.display()),
        // a loop of links is there, and what the system says of it comes below
        (None, _) if path.is_symlink() && is_missing(&path) => {
            let target = std::fs::read_link(&path).unwrap_or_default();
            format!("is a link to {}, which is not there", target.display())
        }
        (None, Some(system)) => format!("cannot be looked at: {system}"),
        (None, None) => "cannot be looked at".to_owned(),
    };
    (path, reason)
}

fn is_missing(path: &Path) -> bool {
    path.metadata().is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound)
}

/// Paths in a row, for messages.
pub(super) fn names(paths: &[PathBuf]) -> String {
    paths.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}

fn source(input: &Path, path: PathBuf) -> veni_light::Result<Source> {
    let system = |e| Error::io(&path, "look at", e);
    let key = path.canonicalize().map_err(&system)?.to_string_lossy().into_owned();
    let meta = path.metadata().map_err(system)?;
    let modified = meta.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
    let modified = modified.map_or(0, |t| u64::try_from(t.as_nanos()).unwrap_or(u64::MAX));
    let given = given(input, &path);
    Ok(Source { key, bytes: meta.len(), modified, given, path })
}

/// The side named by the input itself or by a folder directly in it.
fn given(input: &Path, path: &Path) -> Option<Split> {
    let named = |name: &std::ffi::OsStr| Split::named(&name.to_string_lossy());
    let inside = path.strip_prefix(input).ok()?.components().next().filter(|_| path != input);
    let first = inside.filter(|c| input.join(c).is_dir()).and_then(|c| named(c.as_os_str()));
    first.or_else(|| input.is_dir().then(|| input.file_name().and_then(named)).flatten())
}

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'))
}

fn is_image(path: &Path) -> bool {
    let hidden = is_hidden(path);
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    if extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str())) {
        return !hidden;
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|f| f.take(16).read_to_end(&mut start));
    !hidden && read.is_ok() && MAGIC.iter().any(|magic| start.starts_with(magic))
}
