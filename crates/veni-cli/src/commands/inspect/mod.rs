//! `veni-cli inspect`: what is inside a model, a latent, an image or a training run.

mod image;
mod latent;
mod model;
pub(crate) mod run;
mod statistics;

use std::fmt::Write as _;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use serde_json::{Map, Value};
use veni_core::Error;

use crate::report::{self, Outcome, Report, is_closed_pipe};

/// Show what is inside models, latents, images and training runs
#[derive(Args, Debug)]
#[command(
    long_about = "Show what is inside models, latents, images and training runs.\n\n\
        Model: sizes, identity, training data, prior. Latent: vectors, lengths, exposure, the model it belongs to. \
        Image: size, storage, attributes, radiance over the sphere, dynamic range, where the sun is, the latent it \
        was baked from. Run folder: how far it is, how good.\n\n\
        The content decides what a file is, not its name. Radiance statistics are weighted by solid angle.",
    after_help = "Examples:\n  \
        veni-cli inspect sky.exr\n  \
        veni-cli inspect --json *.exr | jq .radiance.max\n  \
        veni-cli inspect runs/small"
)]
pub(crate) struct Inspect {
    /// Files, or folders of training runs
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

impl Inspect {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let mut failed = Vec::new();
        for path in &self.files {
            match describe(path) {
                Ok(facts) => report.result(facts.text(path), &facts.json(path))?,
                Err(error) if is_closed_pipe(&error) => return Err(error),
                Err(error) => failed.push(error),
            }
        }
        report::last_of(failed)
    }
}

/// What a path turned out to be, and its properties in the order to show them.
pub(super) struct Facts {
    kind: &'static str,
    rows: Vec<(&'static str, String)>,
    json: Map<String, Value>,
}

impl Facts {
    pub(super) fn new(kind: &'static str) -> Self {
        Self { kind, rows: Vec::new(), json: Map::new() }
    }

    /// A property: a line of text, and the same for machines.
    pub(super) fn add(&mut self, name: &'static str, text: impl Into<String>, json: impl Into<Value>) {
        self.rows.push((name, text.into()));
        self.json.insert(name.replace(' ', "_"), json.into());
    }

    /// A property whose name comes from the file; machines find it under `attributes`.
    pub(super) fn attribute(&mut self, name: &str, value: &str) {
        let all = self.json.entry("attributes").or_insert_with(|| Value::Object(Map::new()));
        if let Value::Object(all) = all {
            all.insert(name.to_owned(), value.into());
        }
        self.rows.push(("attribute", format!("{name} = {value}")));
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.json.contains_key(name)
    }

    fn text(&self, path: &Path) -> String {
        let mut text = format!("{}: {}", path.display(), self.kind);
        let width = self.rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        for (name, value) in &self.rows {
            // writing to a String cannot fail
            let _ = write!(text, "\n  {name:width$}  {value}");
        }
        text
    }

    fn json(&self, path: &Path) -> Value {
        let mut object = Map::new();
        object.insert("file".into(), path.display().to_string().into());
        object.insert("kind".into(), self.kind.into());
        object.extend(self.json.clone());
        object.into()
    }
}

fn describe(path: &Path) -> Result<Facts> {
    if path.is_dir() {
        return run::describe(path);
    }
    let mut start = Vec::new();
    let mut file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    file.by_ref().take(64).read_to_end(&mut start).map_err(|e| Error::io(path, "read", e))?;
    drop(file);
    match start.as_slice() {
        [] => bail!("{}: the file is empty; nothing can be said about it", path.display()),
        // safetensors: the length of a JSON header in 8 bytes, then that header
        [_, _, _, _, _, 0, 0, 0, b'{', ..] => model::describe(path),
        text if text.trim_ascii_start().starts_with(b"{") => latent::describe(path),
        _ => image::describe(path),
    }
}
