//! `veni-cli inspect`: what is inside a model, a latent, an image or a training run, and which graphics devices there are.

#[cfg(feature = "gpu")]
mod devices;
mod display;
mod facts;
mod image;
mod latent;
mod model;
pub(crate) mod run;
mod statistics;
mod texture;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use veni_image::LdrPanorama;
use veni_image::texture::{EnvHeader, Ktx2Header};
use veni_light::Error;

use crate::args::Layer;
use crate::features::{GPU, only};
use crate::report::{self, Outcome, Report};
use facts::Facts;

/// What is said of graphics devices.
const DEVICES: &str = "\n\nWith --devices: every graphics device that could bake, the first of them being the one that \
    '--device gpu' takes. Backend and driver, what it allows, which optional features (f16, subgroups) the decoder uses \
    there, its measured rate of multiply-adds, and whether its numbers agree with the CPU's. The exit code is 1 if there \
    is none, or if one cannot be used or computes wrong numbers.";

#[cfg_attr(
    feature = "gpu",
    doc = "Show what is inside models, latents, images, textures and training runs, or the graphics devices"
)]
#[cfg_attr(
    not(feature = "gpu"),
    doc = "Show what is inside models, latents, images, textures and training runs"
)]
#[derive(Args, Debug)]
#[command(
    long_about = format!("Show what is inside models, latents, images, textures and training runs.\n\n\
        Model: sizes, identity, training data, prior. Latent: vectors, lengths, exposure, the model it belongs to. \
        Image: size, storage, attributes, radiance over the sphere, dynamic range, where the sun is, the latent it \
        was baked from, what is unknown of it, and what the file says that is not applied. Texture (KTX2, Babylon.js .env): \
        format, size, faces, levels. Run folder: how far it is, how good.\n\n\
        The content decides what a file is, not its name. Radiance statistics are weighted by solid angle.{}",
        only(GPU, DEVICES)),
    after_help = format!("Examples:\n  \
        veni-cli inspect sky.exr\n  \
        veni-cli inspect --json *.exr | jq .radiance.max\n  \
        veni-cli inspect runs/small{}",
        only(GPU, "\n  veni-cli inspect --devices"))
)]
pub(crate) struct Inspect {
    /// Files, or folders of training runs
    #[cfg_attr(feature = "gpu", arg(required_unless_present = "devices"))]
    #[cfg_attr(not(feature = "gpu"), arg(required = true))]
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,

    #[command(flatten)]
    layer: Layer,

    /// List the graphics devices instead, and measure and check each
    #[cfg(feature = "gpu")]
    #[arg(long, conflicts_with = "files")]
    devices: bool,
}

impl Inspect {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        #[cfg(feature = "gpu")]
        if self.devices {
            return devices::run(report);
        }
        report::each(&self.files, |path| {
            let name = path.display().to_string();
            let facts = describe(path, &self.layer)?;
            report.result(facts.text(&name), &facts.json("file", &name))
        })
    }
}

fn describe(path: &Path, layer: &Layer) -> Result<Facts> {
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
        start if Ktx2Header::recognises(start) => texture::ktx2(path),
        start if EnvHeader::recognises(start) => texture::env(path),
        text if text.trim_ascii_start().starts_with(b"{") => latent::describe(path),
        _ if LdrPanorama::recognise(path)? => display::describe(path),
        _ => image::describe(path, layer),
    }
}
