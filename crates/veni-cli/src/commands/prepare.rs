//! `veni-cli prepare`: any pile of panoramas to a checked training folder.

mod contact;
mod expand;
mod gone;
mod network;
mod place;
mod record;
mod report;
mod scan;
mod store;
mod work;

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use veni_data::prepare::{PrepareConfig, Shares};
use veni_light::sphere::Equirect;

use crate::args::{Force, Layer};
use crate::features::{LEARN, only};
use crate::report::{Outcome, Report};
use crate::shard::Shard;
use crate::size::Size;
use expand::Expand;
use place::Placing;
use store::{Settings, Store};

/// Turn a folder of panoramas into a checked training folder
#[derive(Args, Debug)]
#[command(
    long_about = "Turn any folder of equirectangular panoramas into a training folder: \
        train/, val/ (and test/) with EXR files of one size, report.md, report.json and contact.png.\n\n\
        Folders are searched to the bottom for OpenEXR and Radiance files and for PNG, JPEG, WebP and (feature avif) AVIF \
        images of any size. Those hold no more than a display's range: their clipped regions are found and the sun and other highlights rebuilt \
        (--expand). Every file is checked; what is broken, not twice as wide as high, too small, black, transparent or one grey \
        is refused and listed with the reason. Sources are never changed.\n\n\
        Panoramas of one capture stay on one side of the split: by name (street_01_4k, street_02_ev-2 and \
        street_01_puresky are one capture; numbers of three digits or more are captures of their own) and by content \
        (near-duplicates at another exposure, rotated about the vertical or mirrored). The side follows from --seed and the \
        capture's name alone. Files inside folders named train, val or test keep their side, unless a near-duplicate is held out.\n\n\
        With --expand-with, a network of your own rebuilds what is clipped: an ONNX file with one float input and \
        one float output, both 1 x 3 x H x W (R, G, B; row 0 is up). It is given the panorama's values in [0, 1], \
        sRGB-coded or linear (--expand-input), and gives linear radiance or its natural logarithm \
        (--expand-output), white being 1 or in a scale of its own (--expand-scale match). Display values up to 0.95 \
        stay as they are, from 250/255 they are the network's, but no darker than stored, and between the two are \
        mixed. Where H and W are free, the panorama is continued round the sides and over the poles by 64 pixels or \
        more, to sides that are multiples of 32; where they are fixed, it is resampled to them. Panoramas for which \
        it gives NaN, infinity or negative radiance are refused.\n\n\
        Stopped half-way, the same command continues where it was; run again, it takes in only what is new or changed; \
        images whose sources are gone are kept and listed. --force starts over and removes what an earlier run wrote into DIR, nothing else.",
    after_help = format!("Exit code 1: ready, but some files were refused.\n\n\
        Examples:\n  \
        veni-cli prepare panoramas/ -o data{}\n  \
        veni-cli prepare hdris/ streets/ -o data --size 256x128 --val 0.1 --test 0.1\n  \
        veni-cli prepare hdris/ -o data --expand off          no LDR images\n  \
        veni-cli prepare ldr/ -o data --expand-with hdrcnn.onnx --expand-output log",
        only(LEARN, " && veni-cli train --data data --out run"))
)]
pub(crate) struct Prepare {
    /// Folders and image files
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,

    /// Folder for the training set, created if missing
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,

    /// Width, or width x height, of the panoramas written; smaller ones are refused
    #[arg(long, value_name = "W|WxH", default_value = "128x64")]
    size: Size,

    /// Share of the captures for validation
    #[arg(long, value_name = "SHARE", default_value = "0.1", value_parser = share)]
    val: f64,

    /// Share of the captures for testing
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = share)]
    test: f64,

    /// Which captures go where
    #[arg(long, short, value_name = "S", default_value = "0")]
    seed: u64,

    /// Split again also what lies in folders named train, val or test
    #[arg(long)]
    resplit: bool,

    #[command(flatten)]
    layer: Layer,

    #[command(flatten)]
    expand: Expand,

    #[command(flatten)]
    shard: Shard,

    #[command(flatten)]
    force: Force,
}

impl Prepare {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let (width, height) = self.size.equirect()?;
        if width < 8 {
            bail!("--size {}: a panorama to learn from has at least 8 x 4 pixels", self.size);
        }
        if self.val + self.test >= 1.0 {
            bail!("--val {} and --test {} leave nothing to train on: give less", self.val, self.test);
        }
        let (expand, network) = self.expand.expander()?;
        let settings = Settings::new(width, height, expand.as_ref(), network).of_layer(&self.layer);
        let config = PrepareConfig { grid: Equirect::new(width, height), expand, read: self.layer.options() };
        let found = scan::scan(&self.inputs, &self.output)?;
        if found.sources.is_empty() {
            bail!("{}: no image files in there; name a folder that has some", scan::names(&self.inputs));
        }
        if self.force.force && self.shard.is_part() {
            bail!(
                "--force would remove what other shards have done: start over without --shard, or remove {}",
                self.output.display()
            );
        }
        let mut store = Store::open(&self.output, &settings, self.force.force, self.shard)?;
        let sources = self.shard.own(&found.sources);
        self.shard.note_idle(found.sources.len(), report);
        work::examine_all(&mut store, &sources, &config, settings.network.as_ref(), report)?;
        expand::warn(&store, settings.network.as_ref(), report);
        if self.shard.is_part() {
            report.note(format_args!(
                "shard {}: {} of {} files examined; when all shards are done, the same command without --shard places the \
                 images",
                self.shard,
                sources.len(),
                found.sources.len()
            ));
            return Ok(Outcome::Fine);
        }
        let shares = Shares { val: self.val, test: self.test };
        let placing = Placing { shares, seed: self.seed, resplit: self.resplit };
        let placed = place::place(&mut store, &placing)?;
        contact::write(&store, &placed)?;
        let gone = gone::sources(&placed, &found.sources);
        gone::note(&gone, report);
        report::write(&store, &settings, &placing, &placed, &found.ignored, &gone)?;
        report::print(&self.output, &placed, &gone, report)
    }
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|s| (0.0..1.0).contains(s));
    share.ok_or_else(|| format!("'{text}' is not a share: give a number from 0 to below 1, like 0.1"))
}
