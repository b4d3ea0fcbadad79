//! A folder that appears whole or not at all.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use veni_light::output::{Overwrite, process_token, write_atomic};

use crate::{
    Error, HALF_ERROR, HalfRange, Panorama, Precision, Result, WriteFormat, WriteOptions, half_error,
};

/// Files on their way into a folder: written beside it, then moved.
pub(super) struct Folder {
    target: PathBuf,
    staged: PathBuf,
    names: Vec<String>,
}

/// Refuses a folder that holds anything, unless it may be replaced: for commands that should refuse before a long computation.
///
/// # Errors
/// [`Error::Exists`], or [`Error::Invalid`] if a file of that name is there.
pub fn refuse_existing(folder: &Path, overwrite: Overwrite) -> Result<()> {
    match folder.read_dir() {
        Ok(mut entries) => {
            let full = entries.next().is_some();
            if full && overwrite == Overwrite::Refuse { Err(Error::exists(folder)) } else { Ok(()) }
        }
        Err(_) if folder.symlink_metadata().is_ok() => Err(Error::invalid("is not a folder").in_file(folder)),
        Err(_) => Ok(()),
    }
}

impl Folder {
    pub(super) fn begin(target: &Path, overwrite: Overwrite) -> Result<Self> {
        refuse_existing(target, overwrite)?;
        let name = (target.file_name())
            .ok_or_else(|| Error::invalid("is not the name of a folder to make").in_file(target))?;
        let staged =
            target.with_file_name(format!(".{}.{:016x}.part", name.to_string_lossy(), process_token()));
        fs::create_dir_all(&staged).map_err(|e| Error::io(target, "create", e))?;
        Ok(Self { target: target.to_path_buf(), staged, names: Vec::new() })
    }

    /// A file of these bytes.
    pub(super) fn add(&mut self, name: &str, bytes: impl AsRef<[u8]>) -> Result<()> {
        let wrap = |e| Error::io(self.target.join(name), "write", e);
        let staged = self.staged.join(name);
        write_atomic(&staged, Overwrite::Refuse, |file| file.write_all(bytes.as_ref()).map_err(wrap))?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// An image as EXR: in half precision where that keeps its values.
    pub(super) fn add_exr(&mut self, name: &str, image: &Panorama) -> Result<()> {
        self.add_values(name, image, true)
    }

    /// The same of values that are not colours.
    pub(super) fn add_numbers(&mut self, name: &str, image: &Panorama) -> Result<()> {
        self.add_values(name, image, false)
    }

    fn add_values(&mut self, name: &str, image: &Panorama, colour: bool) -> Result<()> {
        let keeps = half_error(image.pixels(), 1.0) <= HALF_ERROR;
        let precision = if keeps { Precision::Half } else { Precision::Float };
        // what little it loses at the dark end is not a reason to refuse
        let half_range = HalfRange::Factor(1.0);
        let options = WriteOptions { half_range, colour, ..WriteOptions::new(WriteFormat::Exr(precision)) };
        image.write(self.staged.join(name), &options)?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Moves everything to its place.
    pub(super) fn finish(self) -> Result<Vec<PathBuf>> {
        if self.target.is_dir() && self.target.read_dir().is_ok_and(|mut entries| entries.next().is_none()) {
            // an empty folder gives way to the new one
            fs::remove_dir(&self.target).map_err(|e| Error::io(&self.target, "replace", e))?;
        }
        let wrap = |e| Error::io(&self.target, "write", e);
        if self.target.exists() {
            for name in &self.names {
                fs::rename(self.staged.join(name), self.target.join(name)).map_err(wrap)?;
            }
        } else {
            fs::rename(&self.staged, &self.target).map_err(wrap)?;
        }
        Ok(self.names.iter().map(|name| self.target.join(name)).collect())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // gone already if it became the target; otherwise nothing of a failure stays
        let _ = fs::remove_dir_all(&self.staged);
    }
}
