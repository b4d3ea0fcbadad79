//! A folder that appears whole or not at all.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use veni_light::output::{Overwrite, OwnFolder, forget, part_beside, remember, write_atomic};

use crate::{
    Error, HALF_ERROR, HalfRange, Panorama, Precision, Result, WriteFormat, WriteOptions, half_error,
};

/// Files on their way into a folder: written beside it, then moved.
pub(super) struct Folder {
    target: PathBuf,
    overwrite: Overwrite,
    staged: OwnFolder,
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
        let wrap = |e| Error::io(target, "create", e);
        if let Some(above) = target.parent() {
            fs::create_dir_all(above).map_err(wrap)?;
        }
        let staged = OwnFolder::create(|| {
            let path = part_beside(target)?;
            fs::create_dir(&path).map_err(wrap)?;
            Ok(path)
        })?;
        Ok(Self { target: target.to_path_buf(), overwrite, staged, names: Vec::new() })
    }

    /// A file of these bytes.
    pub(super) fn add(&mut self, name: &str, bytes: impl AsRef<[u8]>) -> Result<()> {
        let wrap = |e| Error::io(self.target.join(name), "write", e);
        let staged = self.staged.path().join(name);
        write_atomic(&staged, Overwrite::Refuse, |file| file.write_all(bytes.as_ref()).map_err(wrap))?;
        self.added(name);
        Ok(())
    }

    /// On a signal it goes with the folder that it is in.
    fn added(&mut self, name: &str) {
        remember(&self.staged.path().join(name));
        self.names.push(name.to_owned());
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
        image.write(self.staged.path().join(name), &options)?;
        self.added(name);
        Ok(())
    }

    /// Moves everything to its place: in one step where nothing is there, else file by file if those there may be replaced.
    pub(super) fn finish(mut self) -> Result<Vec<PathBuf>> {
        let files = self.names.iter().map(|name| self.target.join(name)).collect();
        match self.staged.publish(&self.target) {
            Err(Error::Exists { .. }) if self.overwrite == Overwrite::Replace => {
                for name in &self.names {
                    fs::rename(self.staged.path().join(name), self.target.join(name))
                        .map_err(|e| Error::io(&self.target, "write", e))?;
                }
            }
            published => published?,
        }
        Ok(files)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        self.names.iter().for_each(|name| forget(&self.staged.path().join(name)));
    }
}
