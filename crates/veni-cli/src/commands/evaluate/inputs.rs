//! Models, panoramas and the output folder of an evaluation.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use veni_core::LoadedModel;
use veni_core::train::config::DeviceKind;
use veni_data::{Fold, panorama_files};
use veni_eval::baseline::BaselineKind;
use veni_eval::codec::FittedBasis;
use veni_light::Error;
use veni_light::output::{Overwrite, below, existing_above, write_atomic};
use veni_light::progress::Observer;

use crate::args::ModelArgs;
use crate::output::{with_remedy, writable};
use crate::source;

/// Says that a folder is an evaluation's.
const MARKER: &str = "evaluation.json";

/// Classical bases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BaselineName {
    /// No baseline
    None,
    /// Spherical harmonics of log radiance, weighted least squares
    Sh,
    /// Spherical Gaussians of either sign in log radiance
    Sg,
    /// A mixture of positive spherical Gaussians in radiance
    Mixture,
}

/// The models to compare, under distinct names.
pub(super) fn subjects(
    models: &[String],
    lights: Option<u8>,
    device: DeviceKind,
) -> Result<Vec<LoadedModel>> {
    let given = if models.is_empty() {
        vec![("veni".to_owned(), None)]
    } else {
        models.iter().map(|text| named(text)).collect::<Result<_>>()?
    };
    // figures are named after their model
    let plain =
        |name: &str| name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect::<String>();
    for (at, (name, _)) in given.iter().enumerate() {
        if given[..at].iter().any(|(other, _)| plain(other) == plain(name)) {
            bail!("--model: two models are called {name}; give each its own name with --model NAME=FILE");
        }
    }
    let device = device.device()?;
    let load = |(name, path): (String, Option<PathBuf>)| {
        let loaded = source::model(&ModelArgs { model: path })?;
        let subject = LoadedModel::new(name, loaded.model, &device).map_err(|e| e.in_file(&loaded.name))?;
        let subject = subject.with_lobes(loaded.lobes);
        // of models beside each other some may draw their lights themselves
        let known = subject.model().config().lights > 0;
        match lights.filter(|_| known) {
            Some(lights) => Ok(subject.with_lights(usize::from(lights))?),
            None => Ok(subject),
        }
    };
    let subjects = given.into_iter().map(load).collect::<Result<Vec<_>>>()?;
    if lights.is_some_and(|lights| lights > 0) && subjects.iter().all(|subject| subject.lights() == 0) {
        bail!(
            "--compact-lights: these models were trained on panoramas with their lights, which they draw; leave it out"
        );
    }
    Ok(subjects)
}

/// The bases asked for, of each size that a model has.
pub(super) fn bases(
    names: &[BaselineName],
    subjects: &[LoadedModel],
    quick: bool,
) -> Result<Vec<FittedBasis>> {
    // with one light where there are lobes, as the sizes of codes inside the program are counted
    let size = |subject: &LoadedModel| match subject.lobes() {
        0 => subject.dimension(),
        lobes => subject.dimension() + 7 * (1 + lobes),
    };
    let mut sizes: Vec<_> = subjects.iter().map(size).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let mut bases = Vec::new();
    for name in names {
        let kind = match name {
            BaselineName::None => continue,
            BaselineName::Sh => BaselineKind::SphericalHarmonics,
            BaselineName::Sg => BaselineKind::SphericalGaussians,
            BaselineName::Mixture => BaselineKind::GaussianMixture,
        };
        for size in &sizes {
            bases.push(FittedBasis::new(kind, *size, quick)?);
        }
    }
    Ok(bases)
}

/// `NAME=FILE`, or a file that is named after itself (a run after its folder).
fn named(text: &str) -> Result<(String, Option<PathBuf>)> {
    let path = PathBuf::from(text);
    if let Some((name, file)) = text.split_once('=')
        && !path.exists()
        && !name.contains(['/', '\\'])
    {
        if name.trim().is_empty() || file.is_empty() {
            bail!("--model {text}: give a name and a file, like ours=model.safetensors");
        }
        return Ok((name.trim().to_owned(), Some(PathBuf::from(file))));
    }
    let own = path.file_stem().filter(|stem| *stem != "model").or_else(|| path.parent()?.file_name());
    let name = own.map_or_else(|| text.to_owned(), |name| name.to_string_lossy().into_owned());
    Ok((name, Some(path)))
}

/// The panorama files, by name; of a folder with `val/` inside those in it. With a fold, what it holds back of those in
/// `train/`.
pub(super) fn panoramas(
    data: &[PathBuf],
    fold: Option<Fold>,
    most: Option<usize>,
    observer: &dyn Observer,
) -> Result<Vec<PathBuf>> {
    let side = if fold.is_some() { "train" } else { "val" };
    let mut files = Vec::new();
    for folder in data {
        let inner = folder.join(side);
        files.extend(panorama_files(if inner.is_dir() { &inner } else { folder }, observer)?);
    }
    files.sort();
    files.dedup();
    if let Some(fold) = fold.filter(|_| !files.is_empty()) {
        files = fold.split(&files).context("--fold")?.0;
    }
    files.truncate(most.unwrap_or(usize::MAX));
    if files.is_empty() {
        let names: Vec<_> = data.iter().map(|d| d.display().to_string()).collect();
        bail!("{}: no .exr or .hdr panorama to evaluate on", names.join(", "));
    }
    Ok(files)
}

/// The training panoramas that baselines know, by name: those of `train`, else of a `train/` in each folder of `data`, or beside it
/// where it is a `val/`; with a fold, what it leaves of them.
pub(super) fn training(
    train: &[PathBuf],
    data: &[PathBuf],
    fold: Option<Fold>,
    observer: &dyn Observer,
) -> Result<Vec<PathBuf>> {
    let near = |folder: &PathBuf| {
        let folder = folder.canonicalize().ok()?;
        let beside = || Some(folder.parent()?.join("train")).filter(|_| folder.ends_with("val"));
        [Some(folder.join("train")), beside()].into_iter().flatten().find(|f| f.is_dir())
    };
    let folders = if train.is_empty() { data.iter().filter_map(near).collect() } else { train.to_vec() };
    if folders.is_empty() {
        let names: Vec<_> = data.iter().map(|d| d.display().to_string()).collect();
        bail!(
            "{}: no train/ in it or beside it; name the folder of training panoramas, which are compared with, with --train",
            names.join(", ")
        );
    }
    let mut files = Vec::new();
    for folder in &folders {
        files.extend(panorama_files(folder, observer)?);
    }
    files.sort();
    files.dedup();
    if let Some(fold) = fold.filter(|_| train.is_empty() && !files.is_empty()) {
        files = fold.split(&files).context("--fold")?.1;
    }
    if files.is_empty() {
        let names: Vec<_> = folders.iter().map(|d| d.display().to_string()).collect();
        bail!("{}: no .exr or .hdr panorama to compare with; name others with --train", names.join(", "));
    }
    Ok(files)
}

/// Refuses a folder that is in use for something else, before any work.
pub(super) fn check_folder(out: &Path) -> Result<()> {
    if !out.exists() {
        return writable(existing_above(out), out);
    }
    if !out.is_dir() {
        bail!("{}: is a file; name a folder for the evaluation with --out", out.display());
    }
    // tables and figures replace those of an earlier run, here and nowhere else
    for folder in ["figures", "results"] {
        below(out, folder)?;
    }
    // a shard that begins at the same time may be writing the marker: hidden files say nothing
    let entries = std::fs::read_dir(out).map_err(|e| Error::io(out, "list", e))?;
    let is_hidden = |name: &std::ffi::OsStr| name.as_encoded_bytes().starts_with(b".");
    let used = entries.into_iter().any(|entry| entry.is_ok_and(|e| !is_hidden(&e.file_name())));
    if used && !out.join(MARKER).is_file() {
        bail!("{}: is not empty and no evaluation's folder; name a new one with --out", out.display());
    }
    writable(out, out)
}

/// Creates the folder with its marker.
pub(super) fn create_folder(out: &Path) -> Result<()> {
    std::fs::create_dir_all(out).map_err(|e| Error::io(out, "create", e))?;
    let marker = out.join(MARKER);
    write_atomic(&marker, Overwrite::Replace, |file| {
        file.write_all(b"{\"format\":1,\"program\":\"veni-cli evaluate\"}\n")
            .map_err(|e| Error::io(&marker, "write", e))
    })
    .map_err(with_remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_called_what_they_are_told_or_after_their_files() {
        let name = |text: &str| named(text).unwrap().0;
        assert_eq!(name("ours=runs/a"), "ours");
        assert_eq!(name("runs/a"), "a");
        assert_eq!(name("runs/a/model.safetensors"), "a");
        assert_eq!(name("weights/veni-27.safetensors"), "veni-27");
        assert_eq!(name("x/a=b.safetensors"), "a=b");
        assert!(named("=x").is_err() && named("a=").is_err());
    }
}
