//! Which panoramas train and which validate.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::dataset::{Dataset, load};
use super::fold::Fold;
use super::generated::generated;
use super::listing::panorama_files;
use super::prepare::capture;
use super::store::PixelStore;
use crate::{Error, Result};
use veni_image::ReadOptions;
use veni_light::progress::{Observer, Silent};
use veni_light::random::{Purpose, stream};
use veni_light::sphere::Equirect;

/// Where panoramas come from and at which resolution they are used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DataConfig {
    /// Folders (or single files). A folder with `train/` and `val/` inside is used as split there; other
    /// panoramas are split by seed, files of one [`capture`](crate::prepare::capture) together.
    pub folders: Vec<PathBuf>,
    /// Which layer of EXR files with several is the panorama ("ViewLayer.Combined").
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layer: Option<String>,
    /// Columns of the resampled panoramas.
    pub width: usize,
    /// Rows of the resampled panoramas.
    pub height: usize,
    /// Share of the panoramas that become validation where the folders do not say.
    pub val_share: f64,
    /// Cross-validation: this part of the panoramas validates instead, and what lies in a `val/` is not used at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fold: Option<Fold>,
    /// Number of generated scenes ([`veni_synth`]) that training has beside them, drawn with the run's seed.
    pub synthetic: usize,
    /// Share of the draws that are generated scenes, in [0, 1]; absent: their share of the panoramas.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub synthetic_share: Option<f64>,
    /// Most MiB that the resampled panoramas (12·W·H bytes each, train, val and generated together) take in memory. A larger
    /// set is in a file that is mapped: slower only where the system lacks the memory to keep its pages.
    pub memory_mib: u64,
    /// Folder of that file, which has no name and goes with the process; absent: the one that holds the run's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scratch: Option<PathBuf>,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            folders: Vec::new(),
            layer: None,
            width: 128,
            height: 64,
            val_share: 0.1,
            fold: None,
            synthetic: 0,
            synthetic_share: None,
            memory_mib: 4096,
            scratch: None,
        }
    }
}

/// Training and validation panoramas.
#[derive(Clone, Debug, PartialEq)]
pub struct Splits {
    /// To learn from.
    pub train: Dataset,
    /// To choose by; may be empty.
    pub val: Dataset,
}

impl Splits {
    /// Reads what `config` names; `seed` decides the split where the folders do not, and the generated scenes. Without
    /// [`DataConfig::scratch`] the file of a large set is in the system's folder for temporary files.
    ///
    /// # Errors
    /// [`Error::Invalid`] without folders, without any training panorama, or if there is not the space for a large set;
    /// otherwise as [`Dataset::load`].
    pub fn open(config: &DataConfig, seed: u64) -> Result<Self> {
        Self::open_observed(config, seed, 0, &std::env::temp_dir(), &Silent)
    }

    /// [`Splits::open`] without up to `lights` compact lights of each panorama, with another folder where
    /// [`DataConfig::scratch`] is absent, and an observer of its progress.
    ///
    /// # Errors
    /// As [`Splits::open`].
    pub fn open_observed(
        config: &DataConfig,
        seed: u64,
        lights: usize,
        scratch: &Path,
        observer: &dyn Observer,
    ) -> Result<Self> {
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
                    train.extend(panorama_files(&inner_train, observer)?);
                }
                if inner_val.is_dir() {
                    val.extend(panorama_files(&inner_val, observer)?);
                }
            } else {
                undecided.extend(panorama_files(folder, observer)?);
            }
        }
        if let Some(fold) = config.fold {
            train.append(&mut undecided);
            (val, train) = fold.split(&train)?;
        }
        let mut left = (undecided.len() as f64 * config.val_share).round() as usize;
        for files in captures_in_order(undecided, seed) {
            if files.len() <= left {
                left -= files.len();
                val.extend(files);
            } else {
                train.extend(files);
            }
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
        let scratch = config.scratch.as_deref().unwrap_or(scratch);
        let (learned, files) = (train.len(), [train, val].concat());
        let all = files.len().saturating_add(config.synthetic);
        let store = PixelStore::new(all, grid, config.memory_mib, scratch)?;
        observer.begin("panorama", "loading", 0, all);
        let options = ReadOptions { layer: config.layer.clone(), ..ReadOptions::default() };
        let mut items = load(&files, grid, lights, &options, |at, item| store.keep(at, item), observer)?;
        items.extend(generated(
            config.synthetic,
            seed,
            (grid, lights),
            |at, item| store.keep(files.len() + at, item),
            observer,
        )?);
        store.seal(&mut items)?;
        let val = items.drain(learned..files.len()).collect();
        Ok(Self { train: Dataset::new(grid, items), val: Dataset::new(grid, val) })
    }
}

/// The files by [`capture`], captures in an order that the seed decides: two files of one light must not be on both
/// sides of a split.
fn captures_in_order(files: Vec<PathBuf>, seed: u64) -> Vec<Vec<PathBuf>> {
    let (mut groups, mut place) = (Vec::<Vec<PathBuf>>::new(), BTreeMap::new());
    for file in files {
        let at = *place.entry(capture(&file)).or_insert(groups.len());
        if at == groups.len() {
            groups.push(Vec::new());
        }
        groups[at].push(file);
    }
    let order = stream(seed, Purpose::Split, 0, 0).permutation(groups.len());
    order.into_iter().map(|at| std::mem::take(&mut groups[at])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    use veni_image::Panorama;
    use veni_image::{Precision, WriteFormat, WriteOptions};

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
        set.items().iter().map(crate::Item::name).collect()
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
    fn no_capture_is_on_both_sides() {
        // four captures in nine files: other sizes, brackets and views of one light
        let files = [
            "meadow_1k.exr",
            "meadow_2k.exr",
            "meadow_puresky.exr",
            "quay.exr",
            "quay_mirrored.exr",
            "roof_01.exr",
            "roof_02.exr",
            "hill_ev-2.exr",
            "hill_ev0.exr",
        ];
        let folder = folder(&files);
        let of = |set: &Dataset| {
            let captures = names(set).into_iter().map(|n| capture(Path::new(&n)));
            captures.collect::<std::collections::BTreeSet<_>>()
        };
        let mut held = std::collections::BTreeSet::new();
        for seed in 0..12 {
            for (share, most) in [(0.25, 2), (0.5, 5), (0.1, 1)] {
                let config = DataConfig { val_share: share, ..config(folder.path()) };
                let splits = Splits::open(&config, seed).unwrap();
                assert_eq!(splits.train.len() + splits.val.len(), files.len());
                assert!(splits.val.len() <= most, "{share}, seed {seed}: {:?}", names(&splits.val));
                assert!(share < 0.2 || !splits.val.is_empty(), "{share}, seed {seed}");
                let (train, val) = (of(&splits.train), of(&splits.val));
                assert!(train.is_disjoint(&val), "{share}, seed {seed}: {train:?} and {val:?}");
                held.extend(val);
            }
        }
        assert_eq!(held.len(), 4, "{held:?}");
    }

    #[test]
    fn each_part_of_a_cross_validation_is_held_back_once() {
        let folder = folder(&["train/a.exr", "train/b.exr", "train/c.exr", "train/d.exr", "val/e.exr"]);
        let split = |text: &str| {
            let fold = Some(text.parse().unwrap());
            Splits::open(&DataConfig { fold, ..config(folder.path()) }, 0)
        };
        let mut held = Vec::new();
        for part in ["1/2", "2/2"] {
            let splits = split(part).unwrap();
            assert_eq!((splits.train.len(), splits.val.len()), (2, 2));
            assert!(names(&splits.train).iter().all(|name| !names(&splits.val).contains(name)));
            held.extend(names(&splits.val));
        }
        held.sort();
        assert_eq!(held.concat(), "abcd");
        assert!(split("5/5").unwrap_err().to_string().contains("fewer folds"));
    }

    #[test]
    fn items_are_at_exposure_zero_and_remember_their_own() {
        let folder = folder(&["train/a.exr"]);
        let set = Splits::open(&config(folder.path()), 0).unwrap().train;
        let item = &set.items()[0];
        assert!(veni_image::exposure::log_exposure(set.grid(), &item.log_radiance).abs() < 1e-5);
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
            assert!(veni_image::exposure::log_exposure(splits.train.grid(), &item.log_radiance).abs() < 1e-5);
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
    fn a_set_beyond_its_memory_is_mapped_and_the_same() {
        let folder = folder(&["train/a.exr", "train/b.exr", "val/c.exr"]);
        let small = DataConfig { synthetic: 2, ..config(folder.path()) };
        let memory = Splits::open(&small, 3).unwrap();
        let scratch = tempfile::tempdir().unwrap();
        let large = DataConfig { memory_mib: 0, scratch: Some(scratch.path().to_path_buf()), ..small };
        let file = Splits::open(&large, 3).unwrap();
        assert_eq!(file, memory);
        assert_ne!(file.train.items()[0], file.train.items()[1]);
        for (splits, mapped) in [(memory, false), (file, true)] {
            let mut all = splits.train.items().iter().chain(splits.val.items());
            assert!(all.all(|item| item.log_radiance.is_mapped() == mapped));
            let bytes = if mapped { 12 * 8 * 4 } else { 0 };
            assert_eq!([splits.train.mapped_bytes(), splits.val.mapped_bytes()], [4 * bytes, bytes]);
        }
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
