//! `DIR/.prepare`: what was examined, so that a run can go on where another stopped.
//!
//! | file | what |
//! |---|---|
//! | `settings.json` | what the images depend on; other settings need `--force` |
//! | `records*.jsonl` | one line per examined file, appended as it is done |
//! | `images/ID.exr` | prepared images that are not placed yet |
//! | `lock` | locked while a run is at work here |
//! | `plan.json` | where each image is, or is being moved: former places, then the wanted one |

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use veni_data::prepare::Expander;
use veni_image::TransferFunction;
use veni_light::Error;
use veni_light::output::{Lock, Overwrite, below, name_new, write_atomic};

use super::network::NetworkSettings;
use super::plan::{self, LOCK, OWN, Plan};
use super::record::Record;
use super::scan::Source;
use crate::args::Layer;
use crate::output::{PROBE, with_remedy, writable};
use crate::shard::Shard;

/// Changes when images, fingerprints or records of an older program can no longer be gone on with.
const FORMAT: u32 = 1;

/// What prepared images depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Settings {
    format: u32,
    pub(super) width: usize,
    pub(super) height: usize,
    /// "off", "srgb", or the gamma.
    pub(super) expand: String,
    /// What expands instead of the fitted functions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) network: Option<NetworkSettings>,
    /// Of EXR files with several layers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    layer: Option<String>,
}

/// The folder that is filled.
pub(super) struct Store {
    root: PathBuf,
    /// By the files' true names.
    records: BTreeMap<String, Record>,
    log: File,
    log_path: PathBuf,
    /// Places of images, relative to the folder, by their id.
    plan: Plan,
    /// Held while the folder is worked in: by one process, or by shards together.
    _lock: Lock,
}

impl Settings {
    pub(super) fn new(
        width: usize,
        height: usize,
        expand: Option<&Expander>,
        network: Option<NetworkSettings>,
    ) -> Self {
        let transfer = expand.map(|e| match e {
            Expander::Fitted(options) => options.transfer,
            Expander::Network(_, options) => options.transfer,
        });
        let expand = match transfer {
            None => "off".to_owned(),
            Some(TransferFunction::Gamma(gamma)) => format!("gamma {gamma}"),
            Some(_) => "srgb".to_owned(),
        };
        Self { format: FORMAT, width, height, expand, network, layer: None }
    }

    pub(super) fn of_layer(self, layer: &Layer) -> Self {
        Self { layer: layer.layer.clone(), ..self }
    }

    /// How LDR images are expanded, in words.
    pub(super) fn expansion(&self) -> String {
        match &self.network {
            Some(network) => format!("{} by {network}", self.expand),
            None => self.expand.clone(),
        }
    }
}

impl Store {
    /// Opens the folder, or makes it. Refuses one that holds other things or was made with other settings; with
    /// `force` it removes what an earlier run wrote and starts over.
    pub(super) fn open(root: &Path, settings: &Settings, force: bool, shard: Shard) -> Result<Self> {
        let own = root.join(OWN);
        if root.exists() && !root.is_dir() {
            bail!("{}: is a file; name a folder", root.display());
        }
        if !force && !own.is_dir() && root.is_dir() {
            let list = |e| Error::io(root, "list", e);
            let names = fs::read_dir(root).map_err(list)?.map(|entry| entry.map(|e| e.file_name()));
            // another shard may have begun this very moment
            let is_ours = |name: &OsString| {
                let name = name.to_string_lossy();
                name == OWN || name.starts_with(PROBE)
            };
            let names = names.collect::<std::io::Result<Vec<_>>>().map_err(list)?;
            if let Some(name) = names.into_iter().find(|name| !is_ours(name)) {
                bail!(
                    "{}: holds other things ({}) already; name a new folder, or add to this one with --force",
                    root.display(),
                    name.to_string_lossy()
                );
            }
        }
        // what is in it may be somebody else's: it leads nowhere else
        let images = below(root, Path::new(OWN).join("images"))?;
        create(root)?;
        writable(root, root)?;
        create(&own)?;
        let lock = own.join(LOCK);
        let lock = if shard.is_part() { Lock::shared(&lock) } else { Lock::exclusive(&lock) };
        let lock = lock.map_err(with_remedy)?;
        if force {
            plan::clear(root, &plan::read(root)?)?;
        }
        create(&images)?;
        let file = below(root, Path::new(OWN).join("settings.json"))?;
        match fs::read(&file) {
            Ok(bytes) => {
                let old: Settings = serde_json::from_slice(&bytes)
                    .with_context(|| format!("{}: damaged; start over with --force", file.display()))?;
                if old != *settings {
                    bail!(
                        "{}: was prepared with other settings (--size {}x{}, expand {}); give them again, name another folder, or \
                         start over with --force",
                        root.display(),
                        old.width,
                        old.height,
                        old.expansion()
                    );
                }
            }
            Err(_) => write_json(&file, settings)?,
        }
        Self::read(root, shard, lock)
    }

    fn read(root: &Path, shard: Shard, lock: Lock) -> Result<Self> {
        let own = root.join(OWN);
        let mut records = BTreeMap::new();
        let mut logs: Vec<PathBuf> = fs::read_dir(&own)
            .map_err(|e| Error::io(&own, "list", e))?
            .filter_map(|e| e.ok().map(|e| e.path()))
            .filter(|p| p.extension().is_some_and(|e| e == "jsonl"))
            .collect();
        logs.sort();
        for log in &logs {
            let text = fs::read_to_string(log).map_err(|e| Error::io(log, "read", e))?;
            // a line that a stopped run left unfinished is not a record; its file is examined again
            for record in text.lines().filter_map(|line| serde_json::from_str::<Record>(line).ok()) {
                if let Some(facts) = record.facts() {
                    plan::check_id(log, &facts.id)?;
                }
                records.insert(record.key.clone(), record);
            }
        }
        let path = below(root, Path::new(OWN).join(log_name(shard)))?;
        let mut log = OpenOptions::new().create(true).append(true).open(&path);
        if let Ok(file) = &mut log
            && file.metadata().is_ok_and(|m| m.len() > 0)
        {
            // ends a torn line; an empty one is not a record either
            file.write_all(b"\n").map_err(|e| Error::io(&path, "write", e))?;
        }
        let log = log.map_err(|e| Error::io(&path, "open", e))?;
        let plan = plan::read(root)?;
        Ok(Self { root: root.to_path_buf(), records, log, log_path: path, plan, _lock: lock })
    }

    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// All records, in the order of the sources' names.
    pub(super) fn records(&self) -> Vec<&Record> {
        let mut all: Vec<_> = self.records.values().collect();
        all.sort_by(|a, b| (&a.source, &a.key).cmp(&(&b.source, &b.key)));
        all
    }

    /// Whether this file was examined, has not changed since, and its image is still there.
    pub(super) fn is_done(&self, source: &Source) -> bool {
        self.records.get(&source.key).is_some_and(|record| {
            record.is_of(source) && record.facts().is_none_or(|facts| self.image(&facts.id).is_some())
        })
    }

    /// Remembers a file that was examined, on disk before this returns.
    pub(super) fn add(&mut self, record: Record) -> Result<()> {
        let mut line = serde_json::to_vec(&record)?;
        line.push(b'\n');
        self.log.write_all(&line).map_err(|e| Error::io(&self.log_path, "write", e))?;
        self.records.insert(record.key.clone(), record);
        Ok(())
    }

    /// Where an image waits until it is placed.
    pub(super) fn waiting(&self, id: &str) -> PathBuf {
        self.root.join(OWN).join("images").join(format!("{id}.exr"))
    }

    /// Where an image is now. The plan's places were checked when it was read.
    pub(super) fn image(&self, id: &str) -> Option<PathBuf> {
        let places = self.plan.get(id).into_iter().flatten().map(|place| self.root.join(place));
        std::iter::once(self.waiting(id)).chain(places).find(|path| path.is_file())
    }

    /// Moves every image to the place that `wanted` names (relative to the folder), and removes those of ids that it does
    /// not. Whenever it is stopped, no image is lost: the plan is on disk before anything moves.
    pub(super) fn move_images(&mut self, wanted: &BTreeMap<String, String>) -> Result<()> {
        self.refuse_others(wanted)?;
        let mut both = self.plan.clone();
        for (id, place) in wanted {
            let places = both.entry(id.clone()).or_default();
            places.retain(|p| p != place);
            places.push(place.clone());
        }
        self.write_plan(both)?;
        // an image made again waits while its former self is still in place
        let owned: BTreeSet<PathBuf> = self.plan.keys().filter_map(|id| self.image(id)).collect();
        for (_, places) in self.plan.iter().filter(|(id, _)| self.waiting(id).is_file()) {
            for former in places.iter().map(|place| self.root.join(place)).filter(|p| !owned.contains(p)) {
                plan::remove(&former)?;
            }
        }
        // first out of the way, then into place: names may be exchanged
        for id in self.plan.keys() {
            let Some(now) = self.image(id) else { continue };
            match wanted.get(id) {
                None => plan::remove(&now)?,
                Some(place) if now != self.root.join(place) => rename(&now, &self.waiting(id))?,
                Some(_) => {}
            }
        }
        for (id, place) in wanted {
            let (from, to) = (self.waiting(id), plan::checked(&self.root, place)?);
            if from.is_file() {
                create(to.parent().unwrap_or(&self.root))?;
                name_new(&from, &to).map_err(|e| Error::io(&to, "write", e))?;
            }
        }
        self.write_plan(wanted.iter().map(|(id, place)| (id.clone(), vec![place.clone()])).collect())
    }

    /// Refuses, before anything moves, places at which there is what no earlier run put there.
    fn refuse_others(&self, wanted: &BTreeMap<String, String>) -> Result<()> {
        let known: BTreeSet<&String> = self.plan.values().flatten().collect();
        for place in wanted.values() {
            let path = plan::checked(&self.root, place)?;
            if !known.contains(place) && path.symlink_metadata().is_ok() {
                bail!(
                    "{}: is there already, and no earlier run wrote it; move it away, or name another folder",
                    path.display()
                );
            }
        }
        Ok(())
    }

    fn write_plan(&mut self, plan: BTreeMap<String, Vec<String>>) -> Result<()> {
        write_json(&self.root.join(OWN).join("plan.json"), &plan)?;
        self.plan = plan;
        Ok(())
    }
}

/// Each shard has a log of its own; a run without shards reads all.
fn log_name(shard: Shard) -> String {
    let part = shard.part();
    match part.of() {
        1 => "records.jsonl".to_owned(),
        of => format!("records-{}-of-{of}.jsonl", part.number()),
    }
}

/// Replaces a JSON file.
pub(super) fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut bytes = serde_json::to_vec_pretty(value)?;
    bytes.push(b'\n');
    write_bytes(path, &bytes)
}

/// Replaces a file.
pub(super) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    let write =
        |file: &mut std::io::BufWriter<File>| file.write_all(bytes).map_err(|e| Error::io(path, "write", e));
    Ok(write_atomic(path, Overwrite::Replace, write)?)
}

fn create(folder: &Path) -> Result<()> {
    Ok(fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?)
}

fn rename(from: &Path, to: &Path) -> Result<()> {
    Ok(fs::rename(from, to).map_err(|e| Error::io(to, "write", e))?)
}
