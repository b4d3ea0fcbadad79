//! Panoramas, ready for use.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::parallel::parallel;
use crate::pixels::Pixels;
use crate::{Error, Result};
use veni_image::exposure::centre_exposure;
use veni_image::{Budget, Panorama, ReadOptions};
use veni_light::progress::{Observer, Silent};
use veni_light::sphere::Equirect;

/// One panorama, ready for use.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Where it was read from.
    pub path: PathBuf,
    /// Natural-log radiance at exposure 0, 3·W·H values.
    pub log_radiance: Pixels,
    /// What was subtracted: the solid-angle-weighted mean of ln(luminance).
    pub log_exposure: f32,
    /// Whether it is a generated scene ([`veni_synth`]).
    pub generated: bool,
}

impl Item {
    /// A clean panorama (positive and finite), resampled to `grid`, as log radiance at exposure 0.
    pub fn new(path: &Path, panorama: &Panorama, grid: Equirect) -> Self {
        let mut log_radiance = panorama.resample(grid).log().into_flattened();
        let log_exposure = centre_exposure(grid, &mut log_radiance);
        Self { path: path.to_path_buf(), log_radiance: log_radiance.into(), log_exposure, generated: false }
    }

    /// File name without extension.
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// Panoramas of one grid. A clone shares them.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    grid: Equirect,
    items: Arc<Vec<Item>>,
}

impl Dataset {
    /// Wraps panoramas that are already log radiance at exposure 0.
    ///
    /// # Panics
    /// If an item does not have 3·W·H values.
    pub fn new(grid: Equirect, items: Vec<Item>) -> Self {
        for item in &items {
            let (have, want) = (item.log_radiance.len(), 3 * grid.len());
            assert_eq!(
                have,
                want,
                "{}: {have} values on a {} × {} grid",
                item.path.display(),
                grid.width,
                grid.height
            );
        }
        Self { grid, items: Arc::new(items) }
    }

    /// Reads, cleans and resamples files, in parallel; the order is kept. At most as many files as there are processors are
    /// in memory at their full size at a time, fewer where their pixels are more than [`Budget::shared`].
    ///
    /// # Errors
    /// The first file (in order) that cannot be read, by name.
    pub fn load(files: &[PathBuf], grid: Equirect) -> Result<Self> {
        Self::load_observed(files, grid, &Silent)
    }

    /// [`Dataset::load`] with an observer of its progress.
    ///
    /// # Errors
    /// As [`Dataset::load`].
    pub fn load_observed(files: &[PathBuf], grid: Equirect, observer: &dyn Observer) -> Result<Self> {
        observer.begin("panorama", "loading", 0, files.len());
        Ok(Self::new(grid, load(files, grid, |_, item| Ok(item), observer)?))
    }

    /// Only the panoramas that are wanted.
    #[must_use]
    pub fn retain(self, wanted: impl Fn(&Item) -> bool) -> Self {
        let mut items = Arc::unwrap_or_clone(self.items);
        items.retain(wanted);
        Self { items: Arc::new(items), ..self }
    }

    /// The pixel grid of every item.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// The panoramas, in order.
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Bytes of the pixels that are in a mapped file.
    pub fn mapped_bytes(&self) -> u64 {
        let mapped = self.items.iter().filter(|item| item.log_radiance.is_mapped());
        mapped.map(|item| size_of_val(item.log_radiance.as_slice()) as u64).sum()
    }

    /// Number of panoramas.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }
}

/// Reads files, in parallel; each panorama goes through `keep` with its place in the list, and advances the
/// observer by one.
pub(super) fn load(
    files: &[PathBuf],
    grid: Equirect,
    keep: impl Fn(usize, Item) -> Result<Item> + Sync,
    observer: &dyn Observer,
) -> Result<Vec<Item>> {
    parallel(files.len(), |at| {
        let claim = Budget::shared().claim_file(&files[at], &ReadOptions::default());
        let item = keep(at, read_item(&files[at], grid)?)?;
        drop(claim);
        observer.advance(1);
        Ok(item)
    })
}

/// The `.exr` and `.hdr` files directly inside `folder`, sorted by name; a file stands for itself.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be listed.
pub fn panorama_files(folder: &Path) -> Result<Vec<PathBuf>> {
    if folder.is_file() {
        return Ok(vec![folder.to_path_buf()]);
    }
    let entries = fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder, "list", e))?.path();
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        if (extension == "exr" || extension == "hdr") && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn read_item(path: &Path, grid: Equirect) -> Result<Item> {
    let mut panorama = Panorama::read(path)?;
    panorama.sanitise().map_err(|e| e.in_file(path))?;
    Ok(Item::new(path, &panorama, grid))
}
