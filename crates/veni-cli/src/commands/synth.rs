//! `veni-cli synth`: generated outdoor scenes as HDR panoramas.

mod files;

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Result, anyhow, bail};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::json;
use veni_image::Sheet;
use veni_image::tonemap::Tonemap;
use veni_image::{Panorama, Precision};
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;
use veni_synth::{Overrides, Scene, Setting, SkyKind, generate};

use crate::args::Force;
use crate::features::{LEARN, only};
use crate::output::{self, with_remedy};
use crate::piped;
use crate::progress::{ProgressBars, duration};
use crate::report::{Outcome, Report};
use crate::shard::Shard;
use crate::size::Size;
use files::Files;

/// More skies than fit on a disk that anyone has.
const MAX_COUNT: u64 = 100_000_000;
/// Columns of a contact sheet.
const COLUMNS: usize = 8;
/// More cells than anyone looks at.
const MAX_CELLS: u64 = 1024;
/// The largest sheet, pixels.
const MAX_PIXELS: usize = 1 << 28;

/// Generate outdoor scenes that nobody photographed
#[derive(Args, Debug)]
#[command(
    long_about = "Generate outdoor scenes that nobody photographed, as HDR panoramas: to train on, or to try things with.\n\n\
        Skies come from a model of the atmosphere (scattering by air, aerosol and ozone of a spherical earth, so dawn \
        and dusk have their colours), with a sun of true size and radiance, fractal clouds lit by it, and around the \
        viewer hills, woods, trees, houses, streets, rocks or water, with shadows and bounced light; at night moon, \
        stars, lamps and windows. Everything is drawn at random unless an option fixes it. Nothing here was learned: \
        'veni-cli sample' draws from the trained model instead.\n\n\
        DIR receives synth-000000.exr, synth-000001.exr, …: linear Rec. 709, z up, in kcd/m². A file in half precision \
        is multiplied by a power of two that its attribute veni:radianceScale records (this program divides by it \
        again); the attribute veni:scene holds all parameters of the scene as JSON. Image k of seed S is the same to the \
        bit whatever the count, the machine's number of cores, or what else is generated.",
    after_help = format!("Examples:\n  \
        veni-cli synth --sheet sheet.png --count 64              only look\n  \
        veni-cli synth -o skies --count 10000                    a training set, 128 x 64 each\n  \
        veni-cli synth -o skies --count 10000 --resume           go on after an interruption\n  \
        veni-cli synth -o dusk --count 20 --scene sunset --place street --size 1024\n  \
        veni-cli synth -o noon --scene clear --sun-elevation 60 --sun-azimuth 0 --turbidity 2.5 --cloud-cover 0{}",
        only(LEARN, "\n  veni-cli train --data hdri --synthetic 10000 --out run   generated while training starts, without files"))
)]
pub(crate) struct Synth {
    /// Folder for the panoramas, created if missing
    #[arg(long, short, value_name = "DIR", required_unless_present = "sheet")]
    output: Option<PathBuf>,

    /// How many scenes
    #[arg(long, short = 'n', value_name = "N", default_value = "1")]
    count: u64,

    /// Seed of the set
    #[arg(long, short, value_name = "S", default_value = "0")]
    seed: u64,

    /// Width, or width x height, of each
    #[arg(long, value_name = "W|WxH", default_value = "128x64")]
    size: Size,

    /// Weather or time of day
    #[arg(long, value_name = "SKY", value_parser = named(&SkyKind::ALL, SkyKind::name))]
    scene: Option<SkyKind>,

    /// What stands around the viewer
    #[arg(long, value_name = "PLACE", value_parser = named(&Setting::ALL, Setting::name))]
    place: Option<Setting>,

    /// Height of the sun above the horizon; negative after sunset
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    sun_elevation: Option<f32>,

    /// Bearing of the sun: 0 is the middle of the image, 90 a quarter of its width to the left
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    sun_azimuth: Option<f32>,

    /// Haze: 2 very clear, 3 clear, 6 hazy, 10 murky
    #[arg(long, value_name = "T")]
    turbidity: Option<f32>,

    /// Share of the sky under cloud, 0 to 1
    #[arg(long, value_name = "C")]
    cloud_cover: Option<f32>,

    /// Share of the light that the ground reflects, 0 to 0.95
    #[arg(long, value_name = "A")]
    ground_albedo: Option<f32>,

    /// Also write a PNG with the first scenes side by side, tonemapped (98 % quantile is white); - is
    /// standard output
    #[arg(long, value_name = "OUT.png")]
    sheet: Option<PathBuf>,

    /// EXR in single precision, in kcd/m² as it stands [default: half]
    #[arg(long)]
    float: bool,

    /// Keep the files of this very set that exist, and write those that are missing
    #[arg(long, conflicts_with = "force")]
    resume: bool,

    #[command(flatten)]
    shard: Shard,

    #[command(flatten)]
    force: Force,
}

/// A parser for values by name.
fn named<T>(all: &'static [T], name: fn(T) -> &'static str) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let names: Vec<_> = all.iter().map(|v| name(*v)).collect();
    PossibleValuesParser::new(names).try_map(move |text| {
        // the first parser lets nothing else through
        all.iter().copied().find(|v| name(*v) == text).ok_or_else(|| format!("{text}: no such name"))
    })
}

impl Synth {
    pub(crate) fn run(mut self, report: Report) -> Result<Outcome> {
        self.sheet = piped::output_if(self.sheet.as_deref(), "png")?;
        let started = Instant::now();
        let overwrite = Overwrite::from(self.force);
        let overrides = self.overrides()?;
        let (width, height) = self.size.equirect()?;
        let grid = Equirect::new(width, height);
        if !(1..=MAX_COUNT).contains(&self.count) {
            bail!("--count {}: give 1 to {MAX_COUNT}", self.count);
        }
        self.shard.refuse("--sheet", self.sheet.is_some())?;
        let own = || (0..self.count).filter(|index| self.shard.pick(*index as usize));
        let count = own().count();
        self.shard.note_idle(self.count as usize, report);
        let sheet = self.new_sheet(grid, overwrite)?;
        let files = match &self.output {
            Some(folder) => {
                let precision = if self.float { Precision::Float } else { Precision::Half };
                Some(Files::open(folder, own(), precision, overwrite, self.resume)?)
            }
            None => None,
        };
        let cells = if sheet.is_some() { self.count.min(MAX_CELLS) } else { 0 };
        let kept = Mutex::new(0u64);
        let progress = ProgressBars::new(report);
        progress.begin("", "sky", Some(count as u64));
        let shared = Mutex::new(sheet);
        let finished = |index: u64, panorama: Option<&Panorama>| -> Result<()> {
            let mut sheet = shared.lock().map_err(|_| anyhow!("a thread was lost"))?;
            if let (Some(sheet), Some(panorama)) = (sheet.as_mut(), panorama)
                && index < cells
            {
                let at = index as usize;
                let tonemap = Tonemap::reference(panorama);
                let pixels = panorama.pixels().iter().map(|p| tonemap.apply_u8(*p));
                sheet.place(at % COLUMNS, at / COLUMNS, pixels);
            }
            progress.add(1);
            Ok(())
        };
        // a file that is there already only counts; the sheet needs its picture all the same
        let failure = Mutex::new(None);
        let wanted = |scene: &Scene| match &files {
            _ if !self.shard.pick(scene.index as usize) => false,
            Some(files) => match files.wanted(scene, grid) {
                Ok(true) => true,
                Ok(false) => {
                    if let Ok(mut kept) = kept.lock() {
                        *kept += 1;
                    }
                    if scene.index < cells {
                        return true;
                    }
                    let _ = finished(scene.index, None);
                    false
                }
                Err(e) => {
                    if let Ok(mut failure) = failure.lock() {
                        failure.get_or_insert(e);
                    }
                    false
                }
            },
            None => true,
        };
        generate(self.seed, 0..self.count, &overrides, grid, wanted, |scene, panorama| -> Result<()> {
            if let Some(files) = &files {
                files.write(&scene, &panorama).map_err(with_remedy)?;
            }
            finished(scene.index, Some(&panorama))
        })?;
        if let Some(error) = failure.into_inner().map_err(|_| anyhow!("a thread was lost"))? {
            return Err(error);
        }
        let kept = kept.into_inner().map_err(|_| anyhow!("a thread was lost"))?;
        let sheet = shared.into_inner().map_err(|_| anyhow!("a thread was lost"))?;
        progress.end();
        if let (Some(sheet), Some(path)) = (sheet, &self.sheet) {
            sheet.write(path, overwrite).map_err(with_remedy)?;
        }
        self.report(report, grid, [count as u64, kept], started)?;
        Ok(Outcome::Fine)
    }

    fn overrides(&self) -> Result<Overrides> {
        let overrides = Overrides {
            sky: self.scene,
            setting: self.place,
            sun_elevation: self.sun_elevation,
            sun_azimuth: self.sun_azimuth,
            turbidity: self.turbidity,
            cloud_cover: self.cloud_cover,
            ground_albedo: self.ground_albedo,
        };
        overrides.check()?;
        Ok(overrides)
    }

    fn new_sheet(&self, grid: Equirect, overwrite: Overwrite) -> Result<Option<Sheet>> {
        let Some(path) = &self.sheet else { return Ok(None) };
        output::check(std::slice::from_ref(path), &["png"], overwrite)?;
        let cells = self.count.min(MAX_CELLS) as usize;
        let (columns, rows) = (COLUMNS.min(cells), cells.div_ceil(COLUMNS));
        if columns * rows * grid.len() > MAX_PIXELS {
            bail!(
                "a sheet of {cells} scenes of {} x {} is too large: give a smaller --size",
                grid.width,
                grid.height
            );
        }
        Ok(Some(Sheet::new(columns, rows, grid.width, grid.height)))
    }

    fn report(
        &self,
        report: Report,
        grid: Equirect,
        [count, kept]: [u64; 2],
        started: Instant,
    ) -> Result<()> {
        let shown = |path: &Option<PathBuf>| path.as_ref().map(|p| p.display().to_string());
        let places: Vec<_> = [shown(&self.output), shown(&self.sheet)].into_iter().flatten().collect();
        let already = if kept > 0 { format!(", {kept} of them there already") } else { String::new() };
        let human = format!(
            "{}: {} scenes of {} x {}, seed {}{already} ({})",
            places.join(", "),
            count,
            grid.width,
            grid.height,
            self.seed,
            duration(started.elapsed())
        );
        let value = json!({
            "folder": shown(&self.output),
            "sheet": shown(&self.sheet),
            "count": count,
            "kept": kept,
            "seed": self.seed,
            "width": grid.width,
            "height": grid.height,
            "seconds": started.elapsed().as_secs_f64(),
        });
        report.result(human, &value)
    }
}
