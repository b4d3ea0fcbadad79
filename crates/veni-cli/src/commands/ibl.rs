//! `veni-cli ibl`: a sky as folders that engines load.

mod unit;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{ArgGroup, Args, ValueEnum};
use serde_json::json;
use veni_gpu::shader::{self, LightDensity};
use veni_image::Panorama;
use veni_image::engine::{self, Engine, Sampling, Sky};
use veni_light::light::{CompactLight, Levels, Light, LightOptions, Prefilter, Sh};
use veni_light::output::Overwrite;
use veni_light::progress::Observer;
use veni_light::sphere::Equirect;

use crate::args::{Decoding, Force, Layer};
use crate::numbers::{finite, positive};
use crate::output::with_remedy;
use crate::piped;
use crate::progress::ProgressBars;
use crate::report::{self, Outcome, Report};
use crate::size::Size;
use crate::source::{self, Named};
use unit::Unit;

/// Where a latent is decoded if nothing else is asked for: decoded skies hold nothing finer than some degrees.
const DECODED: Equirect = Equirect { width: 2048, height: 1024 };

/// Samples for shaders are of a map of this size at most: the sun, which is the finest part, is apart.
const SAMPLED: Equirect = Equirect { width: 1024, height: 512 };

/// Make a sky ready for an engine: maps, sun, and the lines that load them
#[derive(Args, Debug)]
#[command(
    group = ArgGroup::new("sky").required(true),
    long_about = "Make a sky ready for an engine: prefiltered maps, the sun as a light of its own, and the lines that load them.\n\n\
        The sky is an HDR panorama, a latent (JSON), or a random one named by --seed. The sun is taken out of it and given to the \
        engine as a directional light with its direction, colour, irradiance and size, so that it throws a sharp shadow and the \
        maps are smooth; --sun keep leaves everything in the maps. Both have the energy of the panorama.\n\n\
        A folder holds exactly what the engine takes, a snippet that loads it, and README.txt. With several engines, each gets a \
        folder of its name in DIR; with one, DIR is its folder.",
    after_help = "Units: radiance in the files is that of the panorama, and the sun's irradiance is in the same unit, so sky and sun \
        agree at any exposure. Engines with physical units get one constant for both, cd/m2 per unit: --exposure K, or \
        --lux L for the illuminance of the ground. Where the panorama is too bright for the file formats, all of it is scaled by \
        a power of two, and the constant makes up for it; the result says so.\n\n\
        Examples:\n  \
        veni-cli ibl sky.exr --engine bevy -o assets/sky\n  \
        veni-cli ibl sky.exr --engine three,blender,godot -o out --turn 90\n  \
        veni-cli ibl --seed 7 --engine filament -o out --lux 40000\n  \
        veni-cli ibl sky.hdr --engine any -o out --sun keep --size 512 --json"
)]
pub(crate) struct Ibl {
    /// HDR panorama, latent file, or baked image; - is standard input
    #[arg(value_name = "INPUT", group = "sky")]
    input: Option<PathBuf>,

    /// A random sky from the model's prior, named by a number
    #[arg(long, short, value_name = "S", group = "sky")]
    seed: Option<u64>,

    /// Which engines, separated by commas
    #[arg(long, short, value_parser = engines(), value_name = "ENGINE", value_delimiter = ',', required = true)]
    engine: Vec<Engine>,

    /// Folder to make
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,

    /// Texels along a face of the sharpest reflections: a power of two from 16 to 2048
    #[arg(long, value_name = "N", default_value = "256", value_parser = faces)]
    size: usize,

    /// Whether the sun becomes a light of its own
    #[arg(long, value_enum, default_value_t)]
    sun: SunMode,

    /// Illuminance of the ground, lux, in engines with physical units
    #[arg(long, value_name = "L", value_parser = positive, conflicts_with = "exposure")]
    lux: Option<f64>,

    /// Luminance of one unit of the panorama's radiance, cd/m2, in engines with physical units [default: 1000]
    #[arg(long, value_name = "K", value_parser = positive)]
    exposure: Option<f64>,

    /// Rotate the sky about the vertical axis (yaw), counter-clockwise seen from above
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = finite, allow_hyphen_values = true,
        hide_default_value = true)]
    turn: f64,

    /// Width, or width x height, of the panorama that backgrounds and path tracers get [default: the panorama's own; 2048 of a latent]
    #[arg(long, value_name = "W|WxH")]
    sky_size: Option<Size>,

    #[command(flatten)]
    layer: Layer,

    #[command(flatten)]
    decoding: Decoding,

    #[command(flatten)]
    force: Force,
}

/// Whether the sun becomes a light of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum SunMode {
    /// Where there is one, it is taken out of the maps and becomes a directional light
    #[default]
    Split,
    /// It stays in the maps
    Keep,
}

/// The engines by their names.
fn engines() -> impl TypedValueParser<Value = Engine> {
    let values = Engine::ALL.map(|engine| PossibleValue::new(engine.name()).help(engine.takes()));
    PossibleValuesParser::new(values).try_map(|name| {
        Engine::ALL.into_iter().find(|engine| engine.name() == name).ok_or("no engine of that name")
    })
}

/// Texels along a face.
fn faces(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(n) if n.is_power_of_two() && (16..=2048).contains(&n) => Ok(n),
        _ => Err("give a power of two from 16 to 2048".to_owned()),
    }
}

/// A sky split as asked.
struct Split {
    /// What maps and panoramas show: without the sun if that is a light.
    map: Panorama,
    /// With the sun; None where it is the map.
    whole: Option<Panorama>,
    sun: Option<CompactLight>,
    /// Irradiance of the ground, of all light.
    up: [f32; 3],
}

impl Ibl {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let folders = self.folders()?;
        let overwrite = Overwrite::from(self.force);
        for (_, folder) in &folders {
            engine::refuse_existing(folder, overwrite).map_err(with_remedy)?;
        }
        let sky_grid =
            self.sky_size.map(|size| size.equirect().map(|(w, h)| Equirect::new(w, h))).transpose()?;
        let started = Instant::now();
        let input = piped::input_if(self.input.as_deref())?;
        let named = Named::new(input.as_deref(), self.seed)?;
        let grid = sky_grid.unwrap_or(DECODED);
        let panorama = source::radiance(named, &self.layer, &self.decoding, grid, report)?.panorama;
        let mut split = self.split(panorama)?;
        let unit =
            Unit::of(split.whole.as_ref().unwrap_or(&split.map), &split.map, folders.iter().map(|f| f.0));
        split.scale(unit.factor());
        if unit.factor() != 1.0 {
            report.note(format_args!(
                "radiance in the files is that of the sky times {}: the file formats hold no more",
                unit.factor()
            ));
        }
        let exposure = match (self.lux, self.exposure) {
            (Some(lux), _) => {
                let up = f64::from(veni_image::luminance(split.up));
                if up <= 0.0 {
                    bail!("--lux {lux}: no light of this sky reaches the ground; give --exposure K");
                }
                lux / up
            }
            (None, k) => k.unwrap_or(1000.0) / f64::from(unit.factor()),
        };
        let levels: Vec<Levels> = folders.iter().filter_map(|(engine, _)| engine.levels(self.size)).collect();
        let map = split.map.environment()?;
        let prefilter = Prefilter::new(map, &levels);
        let sh = Sh::of(map);
        let resampled = |image: &Panorama| sky_grid.filter(|g| *g != image.grid()).map(|g| image.resample(g));
        let (small, small_whole) = (resampled(&split.map), split.whole.as_ref().and_then(resampled));
        let panorama = small.as_ref().unwrap_or(&split.map);
        let background = small_whole.as_ref().or(split.whole.as_ref()).unwrap_or(panorama);
        let sky = Sky {
            prefilter: &prefilter,
            panorama,
            sh: &sh,
            background,
            sun: split.sun,
            size: self.size,
            exposure,
            sampling: folders.iter().any(|f| f.0 == Engine::Any).then(|| split.sampling()).transpose()?,
        };
        let progress = ProgressBars::new(report);
        let images: usize = folders.iter().map(|(engine, _)| engine.images(self.size)).sum();
        Observer::begin(&progress, "image", "", 0, images);
        let outcome = report::each(&folders, |(engine, folder)| {
            let files = engine::write(*engine, &sky, folder, overwrite, &progress).map_err(with_remedy)?;
            self.report(*engine, folder, &files, &sky, unit, started, report)
        });
        progress.end();
        outcome
    }

    /// Each engine and its folder.
    fn folders(&self) -> Result<Vec<(Engine, PathBuf)>> {
        let mut folders: Vec<(Engine, PathBuf)> = Vec::new();
        for engine in self.engine.iter().copied() {
            if folders.iter().any(|(other, _)| *other == engine) {
                bail!("--engine names {} twice", engine.name());
            }
            folders.push((engine, self.output.join(engine.name())));
        }
        if let [(_, folder)] = folders.as_mut_slice() {
            self.output.clone_into(folder);
        }
        Ok(folders)
    }

    /// Takes the sun out and rotates everything.
    fn split(&self, panorama: Panorama) -> Result<Split> {
        let angle = self.turn.to_radians();
        let rotated = |p: Panorama| if angle == 0.0 { p } else { p.rotated(angle) };
        let light = LightOptions { lights: 1, ..LightOptions::default() }.of(panorama.environment()?)?;
        let up = light.irradiance([0.0, 0.0, 1.0]);
        match light.sun().filter(|_| self.sun == SunMode::Split).map(|sun| sun.rotated(angle)) {
            Some(sun) => {
                let rest = Panorama::new(panorama.grid(), light.into_residual());
                Ok(Split { map: rotated(rest), whole: Some(rotated(panorama)), sun: Some(sun), up })
            }
            None => Ok(Split { map: rotated(panorama), whole: None, sun: None, up }),
        }
    }

    #[allow(clippy::too_many_arguments, reason = "all that is said of a folder")]
    fn report(
        &self,
        engine: Engine,
        folder: &std::path::Path,
        files: &[PathBuf],
        sky: &Sky<'_>,
        unit: Unit,
        started: Instant,
        report: Report,
    ) -> Result<()> {
        let seconds = started.elapsed().as_secs_f64();
        let sun = match &sky.sun {
            Some(sun) => format!(
                "sun at azimuth {:.1}°, elevation {:.1}°, irradiance {:.3} {:.3} {:.3}",
                sun.azimuth().to_degrees(),
                sun.elevation().to_degrees(),
                sun.irradiance[0],
                sun.irradiance[1],
                sun.irradiance[2]
            ),
            None if self.sun == SunMode::Keep => "sun in the maps".to_owned(),
            None => "no sun".to_owned(),
        };
        let names: Vec<_> = files.iter().map(|f| f.display().to_string()).collect();
        let human =
            format!("{}: {}, {sun} ({} files, {seconds:.2} s)", folder.display(), engine.name(), files.len());
        let value = json!({
            "engine": engine.name(),
            "folder": folder.display().to_string(),
            "files": names,
            "size": self.size,
            "sun": sky.sun.map(|sun| json!({
                "direction": sun.direction,
                "azimuth": sun.azimuth().to_degrees(),
                "elevation": sun.elevation().to_degrees(),
                "irradiance": sun.irradiance,
                "radius": sun.radius.to_degrees(),
                "radius_source": sun.radius_source.to_string(),
            })),
            "radiance_scale": unit.factor(),
            "exposure": sky.exposure,
            "seconds": seconds,
        });
        report.result(human, &value)
    }
}

impl Split {
    /// Samples of it in a shader.
    fn sampling(&self) -> Result<Sampling> {
        let map = self.map.grid();
        let small = (map.width > SAMPLED.width).then(|| self.map.resample(SAMPLED));
        let light = Light::of_parts(small.as_ref().unwrap_or(&self.map).environment()?, self.sun);
        let packed = shader::pack_light(&light, LightDensity::Luminance)?;
        Ok(Sampling {
            wgsl: format!("{}\n{}", shader::light_bindings(0, 0), shader::light()),
            buffers: vec![
                ("veni_light", packed.uniform.to_bytes().to_vec()),
                ("veni_light_cells", packed.cells.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()),
                ("veni_light_texels", packed.texels.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()),
            ],
        })
    }

    fn scale(&mut self, factor: f32) {
        if factor == 1.0 {
            return;
        }
        self.map.scale(factor);
        if let Some(whole) = &mut self.whole {
            whole.scale(factor);
        }
        if let Some(sun) = &mut self.sun {
            sun.irradiance = sun.irradiance.map(|e| e * factor);
        }
        self.up = self.up.map(|e| e * factor);
    }
}
