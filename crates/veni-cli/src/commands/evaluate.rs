//! `veni-cli evaluate`: the experiments of the paper on models and panoramas of one's own.

mod inputs;

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use serde_json::json;
use veni_core::train::config::DeviceKind;
use veni_data::{Dataset, Fold, Part};
use veni_eval::codec::Codec;
use veni_eval::lpips::{self, Lpips};
use veni_eval::protocol::{
    Evaluation, Published, Report as Findings, Settings, ablations, completion, consistency, dataset_size,
    equivariance, interpolation, inverse_rendering, light, paper, photo, realism, reconstruction, spheres,
    uniqueness,
};
use veni_eval::store::ResultStore;
use veni_eval::table::{Format, Table};
use veni_light::Error;
use veni_light::output::{Overwrite, write_atomic};
use veni_light::sphere::Equirect;

use crate::args::Layer;
use crate::output::with_remedy;
use crate::part::fold;
use crate::printable::printable_json;
use crate::progress::ProgressBars;
use crate::report::{Outcome, Report, lines_to_stdout};
use crate::shard::Shard;
use crate::size::Size;
use inputs::BaselineName;

/// The fewest rows on which structural similarity is defined.
const MIN_HEIGHT: usize = 8;

/// Run an experiment of the paper on models and panoramas
#[derive(Args, Debug)]
#[command(
    long_about = "Run an experiment of the paper on models and panoramas.\n\n\
        Tables go to stdout and, with those of every panorama, into OUT, beside figures (PNG). Whatever takes long is \
        kept in OUT/results, one small file per panorama and setting: run the same command again after a stop and it \
        continues; run it with other models, panoramas or settings and only what is new is computed.\n\n\
        DIR holds equirectangular OpenEXR or Radiance files; of a folder with train/ and val/ inside, val/ is taken, and \
        train/ is what photo and completion know beforehand (--train). Every definition is in docs/MODEL.md, Evaluation.\n\n\
        --shard I/N computes a share of what is kept, and makes no tables; once all shares are there, the same command \
        without it finds them. They may run at once, on machines with one file system.\n\n\
        LPIPS needs weights, which do not come with this program: name a safetensors file or what torch.save wrote, \
        with AlexNet's features (torchvision's alexnet-owt-….pth, 'features.N.weight') and the five heads (the lpips \
        package's weights/v0.1/alex.pth, 'linL.model.1.weight'), in one file or in two; a checkpoint of the reference \
        implementation's trainer has both. Without, the column says \"no weights\".",
    after_help = "Examples:\n  \
        veni-cli evaluate reconstruction --data hdri --out eval\n  \
        veni-cli evaluate reconstruction --model ours=runs/a base=runs/b --data hdri --out eval --quick\n  \
        veni-cli evaluate uniqueness --model runs/a --data hdri --images 20 --out eval --table csv\n  \
        veni-cli evaluate uniqueness --model runs/a --data hdri --out eval --shard 2/4     the second of four\n  \
        veni-cli evaluate photo --data hdri --size 256 --out eval     the light of photographs, against hdri/train\n  \
        veni-cli evaluate completion --data mine --train hdri/train --out eval\n  \
        veni-cli evaluate paper --model veni=runs/a reni=runs/r --data hdri --out eval --lpips alexnet.pth alex.pth"
)]
pub(crate) struct Evaluate {
    /// The experiment
    #[arg(value_enum)]
    protocol: Protocol,

    /// Models (.safetensors, training runs' folders, or 27, 147, 300, vectors-147, vectors-300: those inside this program), each with a name for
    /// the tables if one is given [default: veni=27]
    #[arg(long = "model", short, value_name = "[NAME=]FILE", num_args = 1..)]
    models: Vec<String>,

    /// Folders of panoramas (or files)
    #[arg(long, value_name = "DIR", num_args = 1.., required = true)]
    data: Vec<PathBuf>,

    /// Folders of the panoramas that baselines of photo and completion know: their mean and the nearest of them [default: train/
    /// in or beside each folder of --data]
    #[arg(long, value_name = "DIR", num_args = 1..)]
    train: Vec<PathBuf>,

    #[command(flatten)]
    layer: Layer,

    /// Folder of tables, figures and kept results, created if missing
    #[arg(long, short, value_name = "OUT")]
    out: PathBuf,

    /// How tables are written
    #[arg(long, value_enum, default_value_t)]
    table: TableFormat,

    /// Weights for LPIPS
    #[arg(long, value_name = "FILE", num_args = 1..)]
    lpips: Vec<PathBuf>,

    /// Bases of the same dimension D as the models' latents, fitted to each panorama, as rows of reconstruction tables
    #[arg(long, value_enum, num_args = 1.., default_values_t = [BaselineName::Sh, BaselineName::Sg])]
    baselines: Vec<BaselineName>,

    /// Also rows of each model with K lobes fitted to each panorama beside its vectors (reconstruction, light, spheres)
    #[arg(long, value_name = "K", num_args = 1..)]
    lobes: Vec<usize>,

    /// Measure up to N compact lights (the sun, lamps) of each panorama beside the vectors of models that were trained without
    /// [default: 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=8))]
    compact_lights: Option<u8>,

    /// Fewer steps, pixels and pairs: a trend in minutes
    #[arg(long)]
    quick: bool,

    /// Seed of everything random
    #[arg(long, short, value_name = "S", default_value = "0")]
    seed: u64,

    /// Cross-validation: the I-th of N parts of the panoramas (of train/, where there is one), which 'veni-cli train
    /// --fold I/N' held back
    #[arg(long, value_name = "I/N", value_parser = fold)]
    fold: Option<Fold>,

    /// Only the first N panoramas by name
    #[arg(long, value_name = "COUNT")]
    images: Option<usize>,

    /// Width, or width x height, at which panoramas are compared
    #[arg(long, value_name = "W|WxH", default_value = "128")]
    size: Size,

    /// Pairs of random latents (consistency) [default: 1000, quick: 200]
    #[arg(long, value_name = "COUNT")]
    pairs: Option<usize>,

    /// Frames per pair, both ends included (interpolation)
    #[arg(long, value_name = "COUNT", default_value = "9")]
    frames: usize,

    /// More numbers of the papers to compare with (paper): JSON {table: {row: {column: number}}}; VENI's LDR
    /// PSNR is known
    #[arg(long, value_name = "FILE")]
    published: Option<PathBuf>,

    #[command(flatten)]
    shard: Shard,
}

/// The experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Protocol {
    /// How much of a panorama survives: PSNR, SSIM, LPIPS through the encoder and optimised
    Reconstruction,
    /// Two fits of one panorama from random starts: are they the same code?
    Uniqueness,
    /// Rank correlation of distances between latents and between their images
    Consistency,
    /// Strips from one panorama to the next, and how even their steps are
    Interpolation,
    /// Encoder, decoder and both under rotations and reflections
    Equivariance,
    /// Reconstruction by models trained on more and fewer panoramas
    DatasetSize,
    /// Models that differ in one part, side by side
    Ablations,
    /// Irradiance and the sun of decoded panoramas against the panoramas' own
    Light,
    /// Three balls under decoded light and under the panoramas' own, as light estimation is judged
    Spheres,
    /// The whole light from a photograph of part of it: irradiance, sun and balls, against the mean and the nearest training
    /// panorama
    Photo,
    /// The hidden half of panoramas, left and lower, against the mean training panorama
    Completion,
    /// Random skies against photographed ones: sun, shadows, patches
    Realism,
    /// The light on a rendered ball (inverse rendering), from dull to shiny
    InverseRendering,
    /// All of them but light, spheres, photo, completion and realism, with published numbers to compare with
    Paper,
}

/// How tables are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableFormat {
    /// Markdown, rounded
    #[default]
    Md,
    /// Comma-separated values with all digits
    Csv,
    /// One line of JSON per table with all digits
    Json,
}

impl From<TableFormat> for Format {
    fn from(format: TableFormat) -> Self {
        match format {
            TableFormat::Md => Self::Markdown,
            TableFormat::Csv => Self::Csv,
            TableFormat::Json => Self::Json,
        }
    }
}

impl Evaluate {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let grid = self.grid()?;
        if self.published.is_some() && self.protocol != Protocol::Paper {
            bail!("--published: only 'evaluate paper' shows published numbers; leave it out");
        }
        if self.shard.is_part() && self.protocol == Protocol::Equivariance {
            bail!(
                "--shard: equivariance keeps nothing that could be shared out; run it once, without --shard"
            );
        }
        let published = self.published.as_deref().map(Published::load).transpose()?.unwrap_or_default();
        if !self.train.is_empty() && !self.protocol.has_baselines() {
            bail!(
                "--train: only 'evaluate photo' and 'evaluate completion' compare with training panoramas; leave it out"
            );
        }
        let progress = ProgressBars::new(report);
        let files = inputs::panoramas(&self.data, self.fold, self.images, &progress)?;
        let known = if self.protocol.has_baselines() && !self.shard.is_part() {
            inputs::training(&self.train, &self.data, self.fold, &progress)?
        } else {
            Vec::new()
        };
        inputs::check_folder(&self.out)?;
        let device = DeviceKind::Flex;
        let subjects = inputs::subjects(&self.models, self.compact_lights, device)?;
        if !self.protocol.knows_lobes()
            && let Some(subject) = subjects.iter().find(|subject| subject.lobes() > 0)
        {
            bail!(
                "--model {}: this experiment is about vectors and lights alone, which are those of model 27; name 27, vectors-147 or \
                 vectors-300",
                subject.name()
            );
        }
        let lpips = if self.lpips.is_empty() { None } else { Some(Lpips::load(&self.lpips, device)?) };
        let load = |files: &[PathBuf]| {
            let data = Dataset::load_observed(files, grid, &self.layer.options(), &progress);
            progress.end();
            data.map_err(with_remedy)
        };
        let (data, train) = (load(&files)?, if known.is_empty() { None } else { Some(load(&known)?) });
        inputs::create_folder(&self.out)?;
        let (store, figures) = (ResultStore::new(&self.out), self.out.join("figures"));
        let settings =
            Settings { seed: self.seed, quick: self.quick, pairs: self.pairs, frames: self.frames };
        let bases = inputs::bases(&self.baselines, &subjects, self.quick)?;
        let others: Vec<&dyn Codec> = bases.iter().map(|basis| basis as &dyn Codec).collect();
        let evaluation = Evaluation {
            subjects: &subjects,
            others: &others,
            lobes: &self.lobes,
            data: &data,
            train: train.as_ref(),
            lpips: lpips.as_ref(),
            settings,
            store: &store,
            figures: &figures,
            observer: &progress,
        };
        if self.shard.is_part() {
            let kept = self.protocol.keep(&evaluation, self.shard.part()).map_err(with_remedy);
            progress.end();
            kept?;
            let (out, shard) = (self.out.display(), self.shard);
            let human =
                format!("{out}: share {shard} is kept; once all are, run without --shard for the tables");
            report.result(human, &json!({ "out": out.to_string(), "shard": shard.to_string() }))?;
            return Ok(Outcome::Fine);
        }
        let found = self.protocol.run(&evaluation, &published).map_err(with_remedy);
        progress.end();
        self.show(&found?, report)?;
        Ok(Outcome::Fine)
    }

    fn grid(&self) -> Result<Equirect> {
        let (width, height) = self.size.equirect()?;
        let least = if self.lpips.is_empty() { MIN_HEIGHT } else { lpips::MIN_SIDE };
        if height < least {
            bail!(
                "--size {}: {height} rows are too few for the metrics; give at least {}x{least}",
                self.size,
                2 * least
            );
        }
        Ok(Equirect::new(width, height))
    }

    /// Tables to files and stdout; what else was written is said on stderr.
    fn show(&self, found: &Findings, report: Report) -> Result<()> {
        let format = if report.is_json() { Format::Json } else { self.table.into() };
        for table in found.tables.iter().chain(&found.details) {
            self.save(table, format)?;
        }
        let texts: Vec<_> = found.tables.iter().map(|table| table.render(format)).collect();
        let texts = texts.join(if format == Format::Json { "" } else { "\n" });
        lines_to_stdout(&if format == Format::Json { printable_json(&texts) } else { texts.into() })?;
        let figures: Vec<_> = found.figures.iter().filter_map(|f| f.file_name()).collect();
        let figures: Vec<_> = figures.iter().map(|f| f.to_string_lossy()).collect();
        report.note(format_args!(
            "{}: tables of {} kinds{}{}",
            self.out.display(),
            found.tables.len() + found.details.len(),
            if figures.is_empty() { "" } else { ", figures " },
            figures.join(", ")
        ));
        Ok(())
    }

    fn save(&self, table: &Table, format: Format) -> Result<()> {
        let path = self.out.join(format!("{}.{}", table.name, format.extension()));
        let text = table.render(format);
        write_atomic(&path, Overwrite::Replace, |file| {
            std::io::Write::write_all(file, text.as_bytes()).map_err(|e| Error::io(&path, "write", e))
        })
        .map_err(with_remedy)
    }
}

impl Protocol {
    /// Whether training panoramas stand beside the models.
    fn has_baselines(self) -> bool {
        matches!(self, Self::Photo | Self::Completion)
    }

    /// Whether it reports codes with lobes.
    fn knows_lobes(self) -> bool {
        matches!(self, Self::Reconstruction | Self::DatasetSize | Self::Light | Self::Spheres)
    }

    fn run(self, evaluation: &Evaluation<'_>, published: &Published) -> veni_light::Result<Findings> {
        match self {
            Self::Reconstruction => reconstruction::run(evaluation),
            Self::Uniqueness => uniqueness::run(evaluation),
            Self::Consistency => consistency::run(evaluation),
            Self::Interpolation => interpolation::run(evaluation),
            Self::Equivariance => equivariance::run(evaluation),
            Self::DatasetSize => dataset_size::run(evaluation),
            Self::Ablations => ablations::run(evaluation),
            Self::Light => light::run(evaluation),
            Self::Spheres => spheres::run(evaluation),
            Self::Photo => photo::run(evaluation),
            Self::Completion => completion::run(evaluation),
            Self::Realism => realism::run(evaluation),
            Self::InverseRendering => inverse_rendering::run(evaluation),
            Self::Paper => paper::run(evaluation, published),
        }
    }

    /// A share of what takes long.
    fn keep(self, evaluation: &Evaluation<'_>, part: Part) -> veni_light::Result<()> {
        match self {
            Self::Reconstruction => reconstruction::keep(evaluation, part),
            Self::Uniqueness => uniqueness::keep(evaluation, part),
            Self::Consistency => consistency::keep(evaluation, part),
            Self::Interpolation => interpolation::keep(evaluation, part),
            Self::Equivariance | Self::Realism => Ok(()),
            Self::DatasetSize => dataset_size::keep(evaluation, part),
            Self::Ablations => ablations::keep(evaluation, part),
            Self::Light => light::keep(evaluation, part),
            Self::Spheres => spheres::keep(evaluation, part),
            Self::Photo => photo::keep(evaluation, part),
            Self::Completion => completion::keep(evaluation, part),
            Self::InverseRendering => inverse_rendering::keep(evaluation, part),
            Self::Paper => paper::keep(evaluation, part),
        }
    }
}
