//! Skies by file or seed, and the images that each of them becomes: what `bake` and `render-probe` take.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use veni_light::latent::Latent;
use veni_light::output::Overwrite;

use crate::numbers::{finite, stops};
use crate::output;
use crate::report::Report;
use crate::shard::Shard;

/// Extensions that can be written.
const EXTENSIONS: [&str; 3] = ["exr", "hdr", "png"];
/// Most random skies of one command.
const MAX_COUNT: u64 = 10_000_000;

/// Where images go.
#[derive(Args, Debug)]
#[group(id = "target", required = true)]
pub(crate) struct Target {
    /// Image to write (.exr, .hdr or .png), for a single sky; may be given several times
    #[arg(long, short, value_name = "OUT", conflicts_with = "out_dir")]
    output: Vec<PathBuf>,

    /// Folder for the images, created if missing; each is named after its sky's file, or seed-S
    #[arg(long, value_name = "DIR")]
    out_dir: Option<PathBuf>,
}

/// How many skies, and what becomes of them.
#[derive(Args, Debug)]
pub(crate) struct Many {
    /// Number of random skies, of the seeds S, S + 1, ...
    #[arg(long, value_name = "COUNT", requires_all = ["seed", "out_dir"], value_parser = count)]
    count: Option<u64>,

    /// Which files to write for each sky
    #[arg(
        long,
        value_enum,
        value_name = "FORMAT",
        value_delimiter = ',',
        default_value = "exr",
        requires = "out_dir"
    )]
    format: Vec<Format>,

    #[command(flatten)]
    pub(crate) shard: Shard,
}

/// What is done to a sky before it is used.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Change {
    /// Rotate the sky about the vertical axis (yaw), counter-clockwise seen from above
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = finite, allow_hyphen_values = true,
        hide_default_value = true)]
    pub(crate) turn: f64,

    /// Make the sky brighter (or, negative, darker) by factors of two
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = stops, allow_hyphen_values = true,
        hide_default_value = true)]
    pub(crate) exposure: f64,
}

impl Change {
    /// The changed latent: what files record.
    pub(crate) fn of(self, latent: &Latent) -> Latent {
        let mut latent =
            if self.turn == 0.0 { latent.clone() } else { latent.turned(self.turn.to_radians()) };
        latent.log_exposure += (self.exposure * std::f64::consts::LN_2) as f32;
        latent
    }
}

/// Formats by extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// OpenEXR, linear
    Exr,
    /// Radiance RGBE, linear
    Hdr,
    /// Tonemapped preview
    Png,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Hdr => "hdr",
            Self::Png => "png",
        }
    }
}

/// A sky and its images.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Job {
    pub(crate) sky: Sky,
    pub(crate) files: Vec<PathBuf>,
}

/// What a sky is named by.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Sky {
    File(PathBuf),
    Seed(u64),
}

/// This process's share of the skies in `files`, or of the random ones from `seed` on. Its images are checked before any
/// work; the names of all skies' images differ.
pub(crate) fn jobs(
    files: &[PathBuf],
    seed: Option<u64>,
    target: &Target,
    many: &Many,
    overwrite: Overwrite,
    report: Report,
) -> Result<Vec<Job>> {
    let skies = match seed {
        Some(seed) => random(seed, many.count.unwrap_or(1))?,
        None => files.iter().cloned().map(Sky::File).collect(),
    };
    many.shard.note_idle(skies.len(), report);
    let Some(folder) = &target.out_dir else {
        if skies.len() > 1 {
            bail!("-o names the images of one sky, not of {}: name a folder with --out-dir DIR", skies.len());
        }
        let jobs = skies.into_iter().map(|sky| Job { sky, files: target.output.clone() });
        let jobs = many.shard.own(&jobs.collect::<Vec<_>>());
        if !jobs.is_empty() {
            output::check(&target.output, &EXTENSIONS, overwrite)?;
        }
        return Ok(jobs);
    };
    let jobs = skies.into_iter().map(|sky| job(sky, folder, &many.format)).collect::<Result<Vec<_>>>()?;
    let images = |jobs: &[Job]| jobs.iter().flat_map(|job| job.files.clone()).collect::<Vec<_>>();
    output::check_distinct(&images(&jobs))?;
    let jobs = many.shard.own(&jobs);
    images(&jobs).iter().try_for_each(|file| output::refuse_existing(file, overwrite))?;
    output::create_folder(folder)?;
    output::check(&images(&jobs), &EXTENSIONS, overwrite)?;
    Ok(jobs)
}

fn random(seed: u64, count: u64) -> Result<Vec<Sky>> {
    let Some(end) = seed.checked_add(count) else {
        bail!("--count {count}: seeds end at {}; start with a smaller one than {seed}", u64::MAX)
    };
    Ok((seed..end).map(Sky::Seed).collect())
}

fn job(sky: Sky, folder: &Path, formats: &[Format]) -> Result<Job> {
    let name = match &sky {
        Sky::File(path) => path.clone(),
        Sky::Seed(seed) => PathBuf::from(format!("seed-{seed}")),
    };
    let files = formats.iter().map(|f| output::named(folder, &name, f.extension())).collect::<Result<_>>()?;
    Ok(Job { sky, files })
}

fn count(text: &str) -> Result<u64, String> {
    match text.parse() {
        Ok(count) if (1..=MAX_COUNT).contains(&count) => Ok(count),
        _ => Err(format!("give a number from 1 to {MAX_COUNT}")),
    }
}
