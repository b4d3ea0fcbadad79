//! Which files of a folder are panoramas; what only looks like one is named.

use std::fs;
use std::path::{Path, PathBuf};

use crate::{Error, Result};
use veni_image::{Budget, Content, ReadOptions};
use veni_light::progress::Observer;

/// Extensions of images with a display's range, which somebody may take for panoramas.
const LOW_RANGE: [&str; 12] =
    ["png", "jpg", "jpeg", "jpe", "webp", "avif", "heic", "heif", "tif", "tiff", "bmp", "gif"];
/// Most of them that are named.
const MOST_NAMED: usize = 5;

/// The `.exr` and `.hdr` files directly inside `folder`, and pictures of other formats that hold high dynamic range (PQ, HLG, gain
/// maps), sorted by name; a file stands for itself. What looks like a panorama
/// and is none to this program (a link to nowhere, an image with a display's range) is left out and reported to `observer`.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be listed.
pub fn panorama_files(folder: &Path, observer: &dyn Observer) -> Result<Vec<PathBuf>> {
    if folder.is_file() {
        return Ok(vec![folder.to_path_buf()]);
    }
    let entries = fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
    let (mut files, mut low_range) = (Vec::new(), Vec::new());
    for entry in entries {
        let path = match entry {
            Ok(entry) => entry.path(),
            Err(e) => {
                observer
                    .note(&format!("{}: an entry cannot be read ({e}) and is left out", folder.display()));
                continue;
            }
        };
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let is_hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        if is_hidden && !path.is_file() {
            continue;
        }
        if extension == "exr" || extension == "hdr" {
            match path.metadata() {
                Ok(meta) if meta.is_file() => files.push(path),
                Ok(meta) => {
                    let what = if meta.is_dir() { "a folder" } else { "a device or a pipe" };
                    observer.note(&format!("{}: is {what}, and left out", path.display()));
                }
                Err(e) => {
                    observer.note(&format!("{}: {}, and left out", path.display(), unreadable(&path, &e)));
                }
            }
        } else if LOW_RANGE.iter().any(|low| extension == *low) {
            if holds_radiance(&path) { files.push(path) } else { low_range.push(path) }
        }
    }
    files.sort();
    low_range.sort();
    if let Some(first) = low_range.first() {
        let named = low_range.iter().skip(1).take(MOST_NAMED - 1).filter_map(|path| path.file_name());
        let named: String = named.map(|name| format!(", {}", name.display())).collect();
        let more = low_range.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        observer.note(&format!(
            "{}{named}{more}: no high dynamic range, left out; expand such panoramas into EXR files first",
            first.display()
        ));
    }
    Ok(files)
}

/// Whether a picture is of high dynamic range all the same: PQ, HLG, a gain map. Few files ask for it, so they are read twice.
fn holds_radiance(path: &Path) -> bool {
    let options = ReadOptions::default();
    let _claim = Budget::shared().claim_file(path, &options);
    matches!(Content::read(path, &options), Ok(Content::Radiance(_)))
}

fn unreadable(path: &Path, error: &std::io::Error) -> String {
    match fs::read_link(path) {
        Ok(target) if error.kind() == std::io::ErrorKind::NotFound => {
            format!("is a link to {}, which is not there", target.display())
        }
        _ => format!("cannot be looked at ({error})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[derive(Default)]
    struct Told(Mutex<Vec<String>>);

    impl Observer for Told {
        fn begin(&self, _: &'static str, _: &str, _: usize, _: usize) {}
        fn advance(&self, _: usize) {}
        fn note(&self, line: &str) {
            self.0.lock().unwrap().push(line.to_owned());
        }
    }

    #[test]
    fn what_looks_like_a_panorama_and_is_none_is_named() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.exr", "a.HDR", "notes.txt", "c.png", "d.JPG", ".#x.exr.txt"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join("e.exr")).unwrap();
        #[cfg(unix)]
        for (to, name) in [("/nonexistent/x.exr", "f.exr"), ("g.exr", "g.exr"), ("nobody", ".#h.exr")] {
            std::os::unix::fs::symlink(to, folder.path().join(name)).unwrap();
        }
        let told = Told::default();
        let files = panorama_files(folder.path(), &told).unwrap();
        assert_eq!(files, ["a.HDR", "b.exr"].map(|name| folder.path().join(name)));
        let mut told = told.0.into_inner().unwrap();
        told.sort();
        let words: &[(&str, &str)] = if cfg!(unix) {
            &[
                ("c.png, d.JPG", "no high dynamic range"),
                ("e.exr", "a folder"),
                ("f.exr", "/nonexistent"),
                ("g.exr", "cannot"),
            ]
        } else {
            &[("c.png, d.JPG", "no high dynamic range"), ("e.exr", "a folder")]
        };
        assert_eq!(told.len(), words.len(), "{told:?}");
        for (line, (name, why)) in told.iter().zip(words) {
            assert!(line.contains(name) && line.contains(why), "{line}");
        }
    }
}
