//! Skies by file or seed, and the images that each of them becomes: what `bake` and `render-probe` take.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use veni_light::latent::Latent;
use veni_light::output::Overwrite;

use crate::numbers::{finite, stops};
use crate::output;
use crate::piped;
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
    /// Image to write (.exr, .hdr or .png), for a single sky; may be given several times; - is standard output
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

    /// Which files to write for each sky, with --out-dir, or what to write to standard output [default: exr]
    #[arg(long, value_enum, value_name = "FORMAT", value_delimiter = ',', requires = "target")]
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
            if self.turn == 0.0 { latent.clone() } else { latent.rotated(self.turn.to_radians()) };
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
    pub(crate) fn extension(self) -> &'static str {
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

impl Sky {
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Seed(_) => None,
        }
    }
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
    let formats = if many.format.is_empty() { &[Format::Exr] } else { many.format.as_slice() };
    let Some(folder) = &target.out_dir else {
        let to_stdout = target.output.iter().any(|file| piped::is_standard(file));
        if !to_stdout && !many.format.is_empty() {
            bail!("--format is for --out-dir and for -o -: the names of other images say their format");
        }
        if skies.len() > 1 {
            bail!("-o names the images of one sky, not of {}: name a folder with --out-dir DIR", skies.len());
        }
        let files = if to_stdout { vec![standard(&target.output, formats)?] } else { target.output.clone() };
        let jobs = skies.into_iter().map(|sky| Job { sky, files: files.clone() });
        let jobs = many.shard.own(&jobs.collect::<Vec<_>>());
        if !jobs.is_empty() {
            output::check(&files, &EXTENSIONS, overwrite)?;
        }
        return with_inputs(jobs);
    };
    let jobs = skies.into_iter().map(|sky| job(sky, folder, formats)).collect::<Result<Vec<_>>>()?;
    let images = |jobs: &[Job]| jobs.iter().flat_map(|job| job.files.clone()).collect::<Vec<_>>();
    output::check_distinct(&images(&jobs))?;
    let jobs = many.shard.own(&jobs);
    images(&jobs).iter().try_for_each(|file| output::refuse_existing(file, overwrite))?;
    output::create_folder(folder)?;
    output::check(&images(&jobs), &EXTENSIONS, overwrite)?;
    with_inputs(jobs)
}

/// What goes to standard output, the only image of the sky.
fn standard(outputs: &[PathBuf], formats: &[Format]) -> Result<PathBuf> {
    let ([output], [format]) = (outputs, formats) else {
        bail!("-o -: standard output takes one image in one format; name files for others");
    };
    piped::output(output, format.extension())
}

/// Jobs whose skies are in files that can be read as often as needed.
fn with_inputs(jobs: Vec<Job>) -> Result<Vec<Job>> {
    let files: Vec<_> = jobs.iter().filter_map(|job| job.sky.file()).map(Path::to_path_buf).collect();
    let mut files = piped::inputs(&files)?.into_iter();
    let read = |job: Job| match job.sky {
        Sky::File(path) => Job { sky: Sky::File(files.next().unwrap_or(path)), ..job },
        Sky::Seed(_) => job,
    };
    Ok(jobs.into_iter().map(read).collect())
}

fn random(seed: u64, count: u64) -> Result<Vec<Sky>> {
    let Some(end) = seed.checked_add(count) else {
        bail!("--count {count}: seeds end at {}; start with a smaller one than {seed}", u64::MAX)
    };
    Ok((seed..end).map(Sky::Seed).collect())
}

fn job(sky: Sky, folder: &Path, formats: &[Format]) -> Result<Job> {
    let name = match &sky {
        Sky::File(path) => piped::names(std::slice::from_ref(path)).remove(0),
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
