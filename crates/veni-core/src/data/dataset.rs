//! A folder of panoramas in memory.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::data::exposure::centre_exposure;
use crate::data::random::{Purpose, permutation, stream};
use crate::panorama::Panorama;
use crate::parallel::parallel;
use crate::sphere::Equirect;
use crate::synth::{Fixed, Scene, render};
use crate::{Error, Result};

/// Hears how far reading and generating have come: panoramas that are there, and panoramas in all. Several threads
/// tell it.
pub type Heard<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// Where panoramas come from and at which resolution they are used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DataConfig {
    /// Folders (or single files). A folder with `train/` and `val/` inside is used as split there; other
    /// panoramas are split by seed.
    pub folders: Vec<PathBuf>,
    /// Columns of the resampled panoramas.
    pub width: usize,
    /// Rows of the resampled panoramas.
    pub height: usize,
    /// Share of the panoramas that become validation where the folders do not say.
    pub val_share: f64,
    /// Number of generated scenes ([`crate::synth`]) that training has beside them, drawn with the run's seed.
    pub synthetic: usize,
    /// Share of the draws that are generated scenes, in [0, 1]; absent: their share of the panoramas.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub synthetic_share: Option<f64>,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            folders: Vec::new(),
            width: 128,
            height: 64,
            val_share: 0.1,
            synthetic: 0,
            synthetic_share: None,
        }
    }
}

/// One panorama, ready for use.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Where it was read from.
    pub path: PathBuf,
    /// Natural-log radiance at exposure 0, 3·W·H values.
    pub log_radiance: Vec<f32>,
    /// What was subtracted: the solid-angle-weighted mean of ln(luminance).
    pub log_exposure: f32,
    /// Whether it is a generated scene ([`crate::synth`]).
    pub generated: bool,
}

impl Item {
    /// A clean panorama (positive and finite), resampled to `grid`, as log radiance at exposure 0.
    pub fn new(path: &Path, panorama: &Panorama, grid: Equirect) -> Self {
        let mut log_radiance = panorama.resample(grid).log().into_flattened();
        let log_exposure = centre_exposure(grid, &mut log_radiance);
        Self { path: path.to_path_buf(), log_radiance, log_exposure, generated: false }
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

/// Training and validation panoramas.
#[derive(Clone, Debug, PartialEq)]
pub struct Splits {
    /// To learn from.
    pub train: Dataset,
    /// To choose by; may be empty.
    pub val: Dataset,
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

    /// Reads, cleans and resamples files, in parallel; the order is kept. As many files as there are processors are
    /// in memory at their full size at a time.
    ///
    /// # Errors
    /// The first file (in order) that cannot be read, by name.
    pub fn load(files: &[PathBuf], grid: Equirect) -> Result<Self> {
        Self::load_heard(files, grid, &|_, _| {})
    }

    /// [`Dataset::load`], telling how far it has come.
    ///
    /// # Errors
    /// As [`Dataset::load`].
    pub fn load_heard(files: &[PathBuf], grid: Equirect, heard: Heard<'_>) -> Result<Self> {
        Ok(Self::new(grid, load(files, grid, heard)?))
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

    /// Number of panoramas.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }
}

impl Splits {
    /// Reads what `config` names; `seed` decides the split where the folders do not, and the generated scenes.
    ///
    /// # Errors
    /// [`Error::Invalid`] without folders or without any training panorama; otherwise as [`Dataset::load`].
    pub fn open(config: &DataConfig, seed: u64) -> Result<Self> {
        Self::open_heard(config, seed, &|_, _| {})
    }

    /// [`Splits::open`], telling how far it has come.
    ///
    /// # Errors
    /// As [`Splits::open`].
    pub fn open_heard(config: &DataConfig, seed: u64, heard: Heard<'_>) -> Result<Self> {
        if config.folders.is_empty() && config.synthetic == 0 {
            return Err(Error::invalid("no data: name at least one folder of EXR or HDR panoramas"));
        }
        if config.width < 2 || config.height < 2 || !(0.0..1.0).contains(&config.val_share) {
            return Err(Error::invalid(format!(
                "data: {} × {} pixels with val_share {}: needs at least 2 × 2 and a share in 0..1",
                config.width, config.height, config.val_share
            )));
        }
        let grid = Equirect::new(config.width, config.height);
        let (mut train, mut val, mut undecided) = (Vec::new(), Vec::new(), Vec::new());
        for folder in &config.folders {
            let [inner_train, inner_val] = ["train", "val"].map(|n| folder.join(n));
            if inner_train.is_dir() || (config.synthetic > 0 && inner_val.is_dir()) {
                if inner_train.is_dir() {
                    train.extend(panorama_files(&inner_train)?);
                }
                if inner_val.is_dir() {
                    val.extend(panorama_files(&inner_val)?);
                }
            } else {
                undecided.extend(panorama_files(folder)?);
            }
        }
        let take = (undecided.len() as f64 * config.val_share).round() as usize;
        let order = permutation(&mut stream(seed, Purpose::Split, 0, 0), undecided.len());
        for (rank, index) in order.into_iter().enumerate() {
            if rank < take { &mut val } else { &mut train }.push(undecided[index].clone());
        }
        train.sort();
        val.sort();
        if train.is_empty() && config.synthetic == 0 {
            let names: Vec<_> = config.folders.iter().map(|f| f.display().to_string()).collect();
            return Err(Error::invalid(format!(
                "{}: no .exr or .hdr panorama to train on",
                names.join(", ")
            )));
        }
        if let Some(share) = config.synthetic_share {
            if !(0.0..=1.0).contains(&share) || config.synthetic == 0 {
                return Err(Error::invalid(format!(
                    "data.synthetic_share = {share} with data.synthetic = {}: needs a share in 0..=1 and generated scenes",
                    config.synthetic
                )));
            }
            if train.is_empty() && share < 1.0 {
                return Err(Error::invalid(format!(
                    "data.synthetic_share = {share}: there is no .exr or .hdr panorama to take the other {} from",
                    1.0 - share
                )));
            }
        }
        let (files, all) = (train.len() + val.len(), train.len() + val.len() + config.synthetic);
        let mut items = load(&train, grid, &|done, _| heard(done, all))?;
        let val = Dataset::load_heard(&val, grid, &|done, _| heard(train.len() + done, all))?;
        items.extend(generated(config.synthetic, seed, grid, &|done, _| heard(files + done, all)));
        Ok(Self { train: Dataset::new(grid, items), val })
    }
}

fn load(files: &[PathBuf], grid: Equirect, heard: Heard<'_>) -> Result<Vec<Item>> {
    let done = AtomicUsize::new(0);
    parallel(files.len(), |at| {
        let item = read_item(&files[at], grid)?;
        heard(done.fetch_add(1, Ordering::Relaxed) + 1, files.len());
        Ok(item)
    })
}

/// Scenes 0..`count` of the set with this seed, in order.
fn generated(count: usize, seed: u64, grid: Equirect, heard: Heard<'_>) -> Vec<Item> {
    let done = AtomicUsize::new(0);
    let make = |index: usize| {
        let panorama = render(&Scene::draw(seed, index as u64, &Fixed::default()), grid);
        let path = format!("synth-{index:06}");
        let item = Item { generated: true, ..Item::new(Path::new(&path), &panorama, grid) };
        heard(done.fetch_add(1, Ordering::Relaxed) + 1, count);
        item
    };
    (0..count).into_par_iter().map(make).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panorama::{Precision, WriteFormat, WriteOptions};

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (i, name) in (0_u8..).zip(names) {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            let sky =
                Panorama::from_fn(Equirect::new(16, 8), |d| [0.1 + f32::from(i), 1.5 + d[0], 2.0 + d[2]]);
            sky.write(&path, &WriteOptions::new(WriteFormat::Exr(Precision::Float))).unwrap();
        }
        folder
    }

    fn config(folder: &Path) -> DataConfig {
        DataConfig {
            folders: vec![folder.to_path_buf()],
            width: 8,
            height: 4,
            val_share: 0.25,
            ..DataConfig::default()
        }
    }

    fn names(set: &Dataset) -> Vec<String> {
        set.items().iter().map(Item::name).collect()
    }

    #[test]
    fn folders_named_train_and_val_decide() {
        let folder = folder(&["train/b.exr", "train/a.exr", "val/c.exr", "train/deeper/d.exr"]);
        let splits = Splits::open(&config(folder.path()), 0).unwrap();
        assert_eq!(
            (names(&splits.train), names(&splits.val)),
            (vec!["a".into(), "b".into()], vec!["c".into()])
        );
    }

    #[test]
    fn a_seed_splits_one_folder_without_loss() {
        let folder = folder(&["a.exr", "b.exr", "c.exr", "d.exr", "e.exr", "f.exr", "g.exr", "h.exr"]);
        let split = |seed| Splits::open(&config(folder.path()), seed).unwrap();
        let first = split(1);
        assert_eq!((first.train.len(), first.val.len()), (6, 2));
        assert_eq!(first, split(1));
        let mut all = [names(&first.train), names(&first.val)].concat();
        all.sort();
        assert_eq!(all.concat(), "abcdefgh");
        assert!((2..20).any(|seed| names(&split(seed).val) != names(&first.val)));
    }

    #[test]
    fn items_are_at_exposure_zero_and_remember_their_own() {
        let folder = folder(&["train/a.exr"]);
        let set = Splits::open(&config(folder.path()), 0).unwrap().train;
        let item = &set.items()[0];
        assert!(crate::data::exposure::log_exposure(set.grid(), &item.log_radiance).abs() < 1e-5);
        // a mean luminance of about 0.2126·0.1 + 0.7152·1.5 + 0.0722·2
        assert!((item.log_exposure.exp() - 1.24).abs() < 0.15, "{}", item.log_exposure.exp());
    }

    #[test]
    fn generated_scenes_follow_the_panoramas_and_the_seed() {
        let folder = folder(&["train/a.exr", "val/b.exr"]);
        let with = DataConfig { synthetic: 3, ..config(folder.path()) };
        let splits = Splits::open(&with, 4).unwrap();
        assert_eq!(names(&splits.train), ["a", "synth-000000", "synth-000001", "synth-000002"]);
        assert_eq!(names(&splits.val), ["b"]);
        assert_eq!(splits, Splits::open(&with, 4).unwrap());
        assert_ne!(splits.train.items()[1], Splits::open(&with, 5).unwrap().train.items()[1]);
        for item in &splits.train.items()[1..] {
            assert!(item.log_radiance.iter().all(|v| v.is_finite()));
            assert!(
                crate::data::exposure::log_exposure(splits.train.grid(), &item.log_radiance).abs() < 1e-5
            );
        }
        let marks = |set: &Dataset| set.items().iter().map(|item| item.generated).collect::<Vec<_>>();
        assert_eq!((marks(&splits.train), marks(&splits.val)), (vec![false, true, true, true], vec![false]));
        let share = |share, synthetic| DataConfig { synthetic_share: Some(share), synthetic, ..with.clone() };
        assert!(Splits::open(&share(0.5, 3), 4).is_ok());
        for (refused, word) in [(share(1.5, 3), "0..=1"), (share(0.5, 0), "generated scenes")] {
            let message = Splits::open(&refused, 4).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
        // alone, and beside a folder that only validates
        fs::remove_dir_all(folder.path().join("train")).unwrap();
        let alone = Splits::open(&with, 4).unwrap();
        assert_eq!((alone.train.items(), names(&alone.val).len()), (&splits.train.items()[1..], 1));
        let message = Splits::open(&share(0.5, 3), 4).unwrap_err().to_string();
        assert!(message.contains("the other 0.5"), "{message}");
        let nothing = Splits::open(&DataConfig { folders: Vec::new(), ..with }, 4).unwrap();
        assert!(nothing.val.is_empty() && nothing.train == alone.train);
    }

    #[test]
    fn errors_name_the_file_or_folder() {
        let folder = folder(&["train/a.exr"]);
        let bad = folder.path().join("train/broken.exr");
        fs::write(&bad, b"no panorama").unwrap();
        let message = Splits::open(&config(folder.path()), 0).unwrap_err().to_string();
        assert!(message.contains("broken.exr"), "{message}");
        let empty = tempfile::tempdir().unwrap();
        let message = Splits::open(&config(empty.path()), 0).unwrap_err().to_string();
        assert!(message.contains(&empty.path().display().to_string()), "{message}");
        assert!(
            Splits::open(&DataConfig::default(), 0).unwrap_err().to_string().contains("at least one folder")
        );
    }
}
