//! `veni-cli bake`: latents to image files.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{ArgGroup, Args};
use serde_json::json;
use veni_light::latent::Latent;
use veni_light::output::Overwrite;
use veni_light::skies::SkyMeasures;

use crate::args::{Decoding, Force, Layer};
use crate::asked::{self, Asked};
use crate::baking::{Baked, Pictures};
use crate::device::Device;
use crate::features::{GPU, only};
use crate::picture::Picture;
use crate::report::{self, Outcome, Report};
use crate::skies::{self, Change, Job, Many, Sky, Target};
use crate::source::{self, Loaded, RandomSkies};

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
        veni-cli bake --seed 7 -o noon.exr --sun 120,55 --overcast 0.2\n  \
        veni-cli bake --seed 7 -o dusk.exr --date 2026-06-21T20:30+02:00 --place 48.1,11.6\n  \
        veni-cli bake sky.exr -o rotated.exr --turn 90 --exposure -1\n  \
        {}veni-cli bake sky.json -o cube.exr --layout cubemap --frame bevy --size 512\n  \
        veni-cli bake latents/*.json --out-dir skies --format exr,png\n  \
        veni-cli bake --seed 0 --count 1000 --out-dir skies --shard 2/4    the second of four processes{}",
        only(GPU, DEVICES),
        "veni-cli bake photo.hdr -o relit.exr                   through the encoder\n  ",
        only(GPU, "\n  veni-cli bake --seed 7 -o sky.exr --device cpu         the same bits whatever card there is"))
)]
pub(crate) struct Bake {
    /// Latent files, baked images, or HDR panoramas; - is standard input
    #[arg(group = "sky", value_name = "LATENT")]
    latents: Vec<PathBuf>,

    /// A random sky from the model's prior, named by a number
    #[arg(long, short, value_name = "S", group = "sky")]
    seed: Option<u64>,

    #[command(flatten)]
    target: Target,

    #[command(flatten)]
    asked: Asked,

    #[command(flatten)]
    change: Change,

    #[command(flatten)]
    pictures: Pictures,

    #[command(flatten)]
    layer: Layer,

    #[command(flatten)]
    decoding: Decoding,

    #[command(flatten)]
    force: Force,

    #[command(flatten)]
    many: Many,
}

/// What all skies of a command are baked with.
struct Baking {
    picture: Picture,
    skies: RandomSkies,
    loaded: Loaded,
    device: Device,
}

impl Bake {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let overwrite = Overwrite::from(self.force);
        let jobs = skies::jobs(&self.latents, self.seed, &self.target, &self.many, overwrite, report)?;
        if self.asked.is_any() && self.seed.is_none() {
            bail!("wishes such as --sun and --overcast are for random skies: name one with --seed S");
        }
        let picture = self.pictures.picture()?;
        let files = jobs.iter().filter_map(|job| job.sky.file());
        let loaded = source::model_of(&self.decoding.model, files)?;
        loaded.model.config().decoder.check_folds().map_err(|e| e.in_file(&loaded.name))?;
        if jobs.iter().any(|job| job.sky.file().is_none()) {
            loaded.note_random(report);
        }
        let device = Device::open(self.decoding.device, &loaded.model, report)?;
        let baking = Baking {
            picture,
            skies: RandomSkies::new(&loaded, self.asked.request(report)?)?,
            loaded,
            device,
        };
        report::each(jobs, |job| self.one(&job, &baking, report))
    }

    /// One sky to its files.
    fn one(&self, job: &Job, baking: &Baking, report: Report) -> Result<()> {
        let Baking { picture, skies, loaded, device } = baking;
        let overwrite = Overwrite::from(self.force);
        let named = match &job.sky {
            Sky::File(path) => source::from_file(path, &self.layer, loaded, report)?,
            Sky::Seed(seed) => skies.sky(*seed)?,
        };
        let latent = self.change.of(&named);
        let on = (device, &loaded.model);
        let baked = self.pictures.write(&job.files, [&named, &latent], picture, on, overwrite, report)?;
        let measures =
            self.asked.is_any().then(|| asked::measured(&latent, device, skies.request())).transpose()?;
        self.report(&baked, &latent, measures, baking, report)
    }

    fn report(
        &self,
        baked: &Baked,
        latent: &Latent,
        measured: Option<SkyMeasures>,
        baking: &Baking,
        report: Report,
    ) -> Result<()> {
        let (picture, device) = (&baking.picture, baking.device.name());
        let Baked { files, precision, seconds } = baked;
        let from = latent.source.as_deref().unwrap_or("unknown source");
        let mut human = format!("{}: {}, {from}", files.join(", "), picture.describe(*precision));
        if let Some(measures) = &measured {
            human += &format!("; came: {}", asked::in_words(measures));
        }
        human += &format!(" ({seconds:.2} s on {device})");
        let grid = picture.grid();
        let mut value = json!({
            "files": files,
            "width": grid.width,
            "height": grid.height,
            "layout": self.pictures.layout(),
            "frame": picture.frame_name(),
            "precision": precision,
            "device": device,
            "latent": serde_json::from_str::<serde_json::Value>(&latent.to_json()?)?,
            "seconds": seconds,
        });
        if let Some(measures) = &measured {
            value["asked"] = asked::request_json(baking.skies.request());
            value["measured"] = asked::measures_json(measures);
        }
        report.result(human, &value)
    }
}
