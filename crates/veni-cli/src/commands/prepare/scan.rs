//! Which files are candidates, and what their folders say about the split.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use anyhow::{Context, Result, bail};
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
    /// Files that are no images.
    pub(super) ignored: Vec<PathBuf>,
}

/// Searches the inputs to the bottom, except the output folder; links to folders are followed.
pub(super) fn scan(inputs: &[PathBuf], output: &Path) -> Result<Found> {
    let output = output.canonicalize().ok();
    let mut found = Found::default();
    let mut seen = BTreeSet::new();
    for input in inputs {
        if !input.exists() {
            bail!("{}: there is no such file or folder", input.display());
        }
        let inside =
            |path: &Path| output.as_deref().is_some_and(|o| path.canonicalize().is_ok_and(|p| p == o));
        let entries = WalkDir::new(input).follow_links(true).sort_by_file_name().into_iter();
        for entry in entries.filter_entry(|e| !(e.file_type().is_dir() && inside(e.path()))) {
            let entry = entry.with_context(|| format!("{}: cannot be searched", input.display()))?;
            if !entry.file_type().is_file() {
                continue;
            }
            let path = entry.into_path();
            // a file that was named is meant
            if path != *input && !is_image(&path) {
                found.ignored.push(path);
                continue;
            }
            let source = source(input, path)?;
            if seen.insert(source.key.clone()) {
                found.sources.push(source);
            }
        }
    }
    found.sources.sort_by(|a, b| a.path.cmp(&b.path));
    found.ignored.sort();
    found.ignored.dedup();
    Ok(found)
}

/// Paths in a row, for messages.
pub(super) fn names(paths: &[PathBuf]) -> String {
    paths.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}

fn source(input: &Path, path: PathBuf) -> Result<Source> {
    let system = |e| Error::io(&path, "look at", e);
    let key = path.canonicalize().map_err(system)?.to_string_lossy().into_owned();
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

fn is_image(path: &Path) -> bool {
    let hidden = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    if extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str())) {
        return !hidden;
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|f| f.take(16).read_to_end(&mut start));
    !hidden && read.is_ok() && MAGIC.iter().any(|magic| start.starts_with(magic))
}
