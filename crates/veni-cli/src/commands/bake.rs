//! `veni-cli bake`: latents to image files.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::{ArgGroup, Args, ValueEnum};
use serde_json::json;
use veni_image::tonemap::{Curve, Tonemap};
use veni_image::{HALF_RANGE, Precision, WriteFormat, WriteOptions};
use veni_light::latent::Latent;
use veni_light::output::Overwrite;

use crate::args::{Decoding, Force, Layer};
use crate::device::Device;
use crate::features::{GPU, only};
use crate::output::{self, with_remedy};
use crate::picture::{FrameName, Layout, Picture, preview_tonemap};
use crate::progress::ProgressBars;
use crate::report::{self, Outcome, Report};
use crate::size::Size;
use crate::skies::{self, Change, Job, Many, Sky, Target};
use crate::source::{self, Loaded};

/// Stands where no PNG is written.
const NEUTRAL: Tonemap = Tonemap { scale: 1.0, curve: Curve::Srgb };

/// What a graphics card changes.
const DEVICES: &str = "Devices: a graphics card bakes the same picture as the CPU to within rounding, and large ones \
    faster; the result says what was used. It needs the card's own driver for Vulkan, Metal or Direct3D 12, and \
    nothing else. 'veni-cli inspect --devices' lists what there is, 'veni-cli bench' measures it.\n\n";

/// Bake a sky to image files
#[derive(Args, Debug)]
#[command(
    group = ArgGroup::new("sky").required(true),
    long_about = format!("Bake a sky to image files.\n\n\
        The sky is a latent: a latent file (JSON), an image that this program baked (its latent is inside), {}or a \
        random one named by --seed. The same seed and model give the same sky \
        for ever.\n\n\
        Several skies, or --count random ones, go to --out-dir, each named after its file or seed.\n\n\
        Formats by extension: .exr (linear, half or float), .hdr (Radiance RGBE), .png (tonemapped preview). An \
        EXR or HDR file carries its latent and the model's hash, so that it can be baked again at any size.",
        "an HDR panorama (encoded on the fly), "),
    after_help = format!("Cube maps: six square faces stacked from top to bottom in the order +X -X +Y -Y +Z -Z of --frame, \
        each oriented as the layers of a cube texture in Vulkan, Direct3D, Metal, OpenGL and WebGPU; the attribute \
        veni:cubeFaces repeats the order. With --frame bevy, z is negated before the lookup, as Bevy's shaders do. \
        Default frame: blender (z up); gltf for cube maps (y up).\n\n\
        With - in place of a file, latents and images come from standard input and go to standard output.\n\n\
        {}Examples:\n  \
        veni-cli bake --seed 7 -o sky.exr                      a random sky, 1024 x 512, half precision\n  \
        veni-cli bake --seed 7 -o sky.exr -o sky.png --size 4096\n  \
        veni-cli bake sky.exr -o rotated.exr --turn 90 --exposure -1\n  \
        {}veni-cli bake sky.json -o cube.exr --layout cubemap --frame bevy --size 512\n  \
        veni-cli bake latents/*.json --out-dir skies --format exr,png\n  \
        veni-cli bake --seed 0 --count 1000 --out-dir skies --shard 2/4    the second of four processes{}",
        only(GPU, DEVICES),
        "veni-cli bake photo.hdr -o relit.exr                   through the encoder\n  ",
        only(GPU, "\n  veni-cli bake --seed 7 -o sky.exr --device cpu         the same bits whatever card there is"))
)]
pub(crate) struct Bake {
    /// Latent files, baked images, or HDR panoramas
    #[arg(group = "sky", value_name = "LATENT")]
    latents: Vec<PathBuf>,

    /// A random sky from the model's prior, named by a number
    #[arg(long, short, value_name = "S", group = "sky")]
    seed: Option<u64>,

    #[command(flatten)]
    target: Target,

    /// Width, or width x height; of one face for cube maps [default: 1024x512, faces of 256]
    #[arg(long, value_name = "W|WxH")]
    size: Option<Size>,

    #[command(flatten)]
    change: Change,

    /// EXR in half precision; fails where radiance exceeds 65504, or is below 6.1e-5, where half precision loses bits
    /// [default: half if it keeps all, else float]
    #[arg(long, conflicts_with = "float")]
    half: bool,

    /// EXR in single precision
    #[arg(long)]
    float: bool,

    /// Arrangement of directions
    #[arg(long, value_enum, default_value_t)]
    layout: Layout,

    /// Axes that a cube map's faces are named by, and that the file says its directions have
    #[arg(long, value_enum)]
    frame: Option<FrameName>,

    #[command(flatten)]
    layer: Layer,

    #[command(flatten)]
    decoding: Decoding,

    #[command(flatten)]
    force: Force,

    #[command(flatten)]
    many: Many,
}

impl Bake {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let overwrite = Overwrite::from(self.force);
        let jobs = skies::jobs(&self.latents, self.seed, &self.target, &self.many, overwrite, report)?;
        let picture = Picture::new(self.layout, self.frame, self.size)?;
        let files = jobs.iter().filter_map(|job| job.sky.file());
        let loaded = source::model_of(&self.decoding.model, files)?;
        loaded.model.config().decoder.check_folds().map_err(|e| e.in_file(&loaded.name))?;
        let device = Device::open(self.decoding.device, &loaded.model, report)?;
        report::each(jobs, |job| {
            job.run(report, |job, report| self.one(job, &picture, &loaded, &device, report))
        })
    }

    /// One sky to its files.
    fn one(
        &self,
        job: &Job,
        picture: &Picture,
        loaded: &Loaded,
        device: &Device,
        report: Report,
    ) -> Result<()> {
        let overwrite = Overwrite::from(self.force);
        let named = match &job.sky {
            Sky::File(path) => source::from_file(path, &self.layer, loaded, report)?,
            Sky::Seed(seed) => source::seeded(&loaded.model, *seed),
        };
        let latent = self.change.of(&named);
        let started = Instant::now();
        let baker = device.condition(&latent)?;
        let png = job.files.iter().any(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")));
        // the exposure of a preview is that of the sky before --exposure, which would otherwise be undone
        let tonemap = if png { preview_tonemap(&device.condition(&named)?)? } else { NEUTRAL };
        let attributes = picture.attributes(&latent, &loaded.model.hash())?;
        let files = |precision| -> veni_light::Result<Vec<_>> {
            let file = |path: &PathBuf| {
                let mut format = WriteFormat::of(path, tonemap)?;
                if let WriteFormat::Exr(p) = &mut format {
                    *p = precision;
                }
                let attributes = attributes.clone();
                Ok((path.clone(), WriteOptions { attributes, overwrite, ..WriteOptions::new(format) }))
            };
            job.files.iter().map(file).collect()
        };
        let (mut precision, may_change) = match (self.half, self.float) {
            (true, _) => (Precision::Half, false),
            (_, true) => (Precision::Float, false),
            _ => (Precision::Half, true),
        };
        // known beforehand of lights, and not found out at their row
        let peak = latent.lights.scaled(latent.log_exposure.exp()).peak(picture.grid());
        if may_change && peak > HALF_RANGE[1] && has_exr(&files(precision)?) && picture.is_panorama() {
            report.note(beyond(peak));
            precision = Precision::Float;
        }
        let progress = ProgressBars::new(report);
        loop {
            let (files, mut range) = (files(precision)?, Range::default());
            let watch = may_change && precision == Precision::Half && has_exr(&files);
            progress.begin("", "row", Some(picture.grid().height as u64));
            let result = output::write_all(&files, picture.grid(), &mut |push| {
                baker.rows(picture.directions(), &mut |row| {
                    range.see(row)?;
                    if watch && range.beyond_half().is_some() {
                        return Err(veni_light::Error::invalid("beyond the range of half precision"));
                    }
                    progress.add(1);
                    push(row)
                })
            });
            progress.end();
            match (result, range.beyond_half()) {
                (Ok(()), _) => break,
                (Err(_), Some(value)) if watch && value >= f32::MIN_POSITIVE => {
                    let [least, most] = HALF_RANGE;
                    report.note(if value > most {
                        beyond(value)
                    } else {
                        format!("half precision loses bits of a radiance of {value:.1e} (below {least:.1e}): writing floats")
                    });
                    precision = Precision::Float;
                }
                (Err(error @ veni_light::Error::Invalid(_)), Some(value)) if self.half => {
                    let change = if value > HALF_RANGE[1] {
                        "darken with --exposure -1 …"
                    } else {
                        "brighten with --exposure 1 …"
                    };
                    bail!("{error} (leave --half out, or {change})")
                }
                (Err(error), _) => return Err(with_remedy(error)),
            }
        }
        self.report(&job.files, picture, &latent, precision, device.name(), started, report)
    }

    #[allow(clippy::too_many_arguments, reason = "all that is said of a file")]
    fn report(
        &self,
        files: &[PathBuf],
        picture: &Picture,
        latent: &Latent,
        precision: Precision,
        device: &str,
        started: Instant,
        report: Report,
    ) -> Result<()> {
        let seconds = started.elapsed().as_secs_f64();
        // the other formats have but one
        let exr = files.iter().any(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")));
        let precision = exr.then_some(if precision == Precision::Half { "half" } else { "float" });
        let from = latent.source.as_deref().unwrap_or("unknown source");
        let files: Vec<_> = files.iter().map(|p| p.display().to_string()).collect();
        let human = format!(
            "{}: {}, {from} ({seconds:.2} s on {device})",
            files.join(", "),
            picture.describe(precision)
        );
        let grid = picture.grid();
        let value = json!({
            "files": files,
            "width": grid.width,
            "height": grid.height,
            "layout": self.layout.to_possible_value().map(|v| v.get_name().to_owned()),
            "frame": picture.frame_name(),
            "precision": precision,
            "device": device,
            "latent": serde_json::from_str::<serde_json::Value>(&latent.to_json()?)?,
            "seconds": seconds,
        });
        report.result(human, &value)
    }
}

fn beyond(value: f32) -> String {
    format!("radiance of {value:.0} is beyond half precision ({}): writing floats", HALF_RANGE[1])
}

/// The smallest and the largest value of what is baked.
#[derive(Clone, Copy, Debug)]
struct Range {
    low: f32,
    high: f32,
}

impl Default for Range {
    fn default() -> Self {
        Self { low: f32::INFINITY, high: 0.0 }
    }
}

impl Range {
    /// Radiance is an exponential: where it is 0, or has lost bits already, it is too small for a number.
    fn see(&mut self, row: &[[f32; 3]]) -> veni_light::Result<()> {
        for value in row.as_flattened().iter().filter(|v| v.is_finite()) {
            (self.low, self.high) = (self.low.min(*value), self.high.max(*value));
        }
        if self.low < f32::MIN_POSITIVE {
            return Err(veni_light::Error::invalid(format!(
                "a radiance of {:e} is below {:.1e}, the smallest number with all its bits: the exposure is too low",
                self.low,
                f32::MIN_POSITIVE
            )));
        }
        Ok(())
    }

    /// The value that half precision does not keep, if there is one.
    fn beyond_half(self) -> Option<f32> {
        let [least, most] = HALF_RANGE;
        [self.high].into_iter().find(|v| *v > most).or(Some(self.low).filter(|v| *v < least))
    }
}

fn has_exr(files: &[(PathBuf, WriteOptions)]) -> bool {
    files.iter().any(|(_, options)| matches!(options.format, WriteFormat::Exr(_)))
}
