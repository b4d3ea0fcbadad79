//! Where the pixels of a set are kept: in memory, or, of a large set, in a file.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::dataset::Item;
use super::pixels::{MappedFile, Pixels};
use crate::{Error, Result};
use veni_light::sphere::Equirect;

const MIB: u64 = 1 << 20;

/// Takes the panoramas of one set while they are read, in any order, and hands them out when all are there.
#[derive(Debug)]
pub(super) struct PixelStore {
    /// f32 values of a panorama.
    values: usize,
    scratch: Option<Scratch>,
}

/// The file of a set that is larger than the memory it may have.
#[derive(Debug)]
struct Scratch {
    folder: PathBuf,
    file: Mutex<File>,
}

impl PixelStore {
    /// For `panoramas` of `grid`. Beyond `memory_mib` they go to a file without a name in `folder`, which vanishes with the
    /// process, however that ends.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is not the space for it, [`Error::Io`] if there can be no file.
    pub(super) fn new(panoramas: usize, grid: Equirect, memory_mib: u64, folder: &Path) -> Result<Self> {
        let values = 3 * grid.len();
        let bytes = (4 * values as u64).saturating_mul(panoramas as u64);
        if bytes <= memory_mib.saturating_mul(MIB) {
            return Ok(Self { values, scratch: None });
        }
        let free = fs4::available_space(folder).map_err(|e| Error::io(folder, HOLD, e))?;
        if free < bytes {
            return Err(Error::invalid(format!(
                "{} of space are left, and {panoramas} panoramas of {} × {} pixels take {}; free some, name another \
                 folder with data.scratch, or keep more in memory than data.memory_mib = {memory_mib}",
                size(free),
                grid.width,
                grid.height,
                size(bytes)
            ))
            .in_file(folder));
        }
        let file = tempfile::tempfile_in(folder).map_err(|e| Error::io(folder, HOLD, e))?;
        Ok(Self { values, scratch: Some(Scratch { folder: folder.to_path_buf(), file: Mutex::new(file) }) })
    }

    /// Keeps panorama `at`, whose pixels are those of `item`: in a file, they are gone from it until [`seal`](Self::seal).
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be written.
    pub(super) fn keep(&self, at: usize, mut item: Item) -> Result<Item> {
        assert_eq!(item.log_radiance.len(), self.values, "values of {}", item.path.display());
        if let Some(scratch) = &self.scratch {
            let place = 4 * (at * self.values) as u64;
            let mut file = scratch.file.lock().unwrap_or_else(PoisonError::into_inner);
            file.seek(SeekFrom::Start(place))
                .and_then(|_| file.write_all(bytemuck::cast_slice(&item.log_radiance)))
                .map_err(|e| Error::io(&scratch.folder, HOLD, e))?;
            item.log_radiance = Vec::new().into();
        }
        Ok(item)
    }

    /// Gives all panoramas their pixels; `items[at]` must be what [`keep`](Self::keep) returned for `at`.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be finished or mapped.
    pub(super) fn seal(self, items: &mut [Item]) -> Result<()> {
        let Some(Scratch { folder, file }) = self.scratch else { return Ok(()) };
        let file = file.into_inner().unwrap_or_else(PoisonError::into_inner);
        // a page of a full disk would be found out at its first touch otherwise, by a signal
        file.sync_data().map_err(|e| Error::io(&folder, HOLD, e))?;
        let file = Arc::new(MappedFile::new(file).map_err(|e| Error::io(&folder, HOLD, e))?);
        for (at, item) in items.iter_mut().enumerate() {
            item.log_radiance = Pixels::mapped(&file, at * self.values..(at + 1) * self.values);
        }
        Ok(())
    }
}

const HOLD: &str = "hold the panoramas in a file (data.scratch names another folder)";

fn size(bytes: u64) -> String {
    let mib = bytes as f64 / MIB as f64;
    if mib < 1024.0 { format!("{mib:.1} MiB") } else { format!("{:.1} GiB", mib / 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const GRID: Equirect = Equirect { width: 32, height: 16 };

    /// Panorama `at`, no value of which another has.
    fn item(at: usize) -> Item {
        Item {
            path: at.to_string().into(),
            log_radiance: (0..3 * GRID.len()).map(|v| (at * 3 * GRID.len() + v) as f32).collect(),
            log_exposure: at as f32,
            lights: veni_light::light::Lights::default(),
            generated: false,
        }
    }

    #[test]
    fn what_is_kept_in_any_order_comes_back_from_memory_and_from_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let expected: Vec<_> = (0..5).map(item).collect();
        // five panoramas are 30 KiB
        for (memory_mib, mapped) in [(1, false), (0, true)] {
            let store = PixelStore::new(5, GRID, memory_mib, folder.path()).unwrap();
            let mut items: Vec<_> = (0..5).map(item).collect();
            for at in [3, 0, 4, 2, 1] {
                items[at] = store.keep(at, item(at)).unwrap();
                assert_eq!(items[at].log_radiance.is_empty(), mapped, "no second copy in memory");
            }
            store.seal(&mut items).unwrap();
            assert!(items.iter().all(|item| item.log_radiance.is_mapped() == mapped));
            assert_eq!(items, expected);
            // pixels outlive the set that they came with
            let last = items.swap_remove(4);
            drop(items);
            assert_eq!(last, expected[4]);
        }
        let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
        assert!(left.is_empty(), "{left:?}");
    }

    #[test]
    fn a_set_that_no_disk_holds_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let message = PixelStore::new(1 << 50, GRID, 4096, folder.path()).unwrap_err().to_string();
        for word in ["32 × 16 pixels", "data.scratch", "data.memory_mib = 4096", "GiB"] {
            assert!(message.contains(word), "{message}");
        }
        let message = PixelStore::new(usize::MAX, GRID, 4096, folder.path()).unwrap_err().to_string();
        assert!(message.contains("space are left"), "{message}");
        let missing = folder.path().join("missing");
        let message = PixelStore::new(1, GRID, 0, &missing).unwrap_err().to_string();
        assert!(message.contains("missing") && message.contains("data.scratch"), "{message}");
        assert!(PixelStore::new(1, GRID, 1, &missing).is_ok(), "small sets need no folder");
    }
}
