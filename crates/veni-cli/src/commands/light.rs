//! `veni-cli light`: the sun and other lights of a panorama or a latent, harmonics, irradiance.

mod choice;
mod convention;
mod print;

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{ArgGroup, Args};
use veni_image::{Panorama, Precision, WriteFormat, WriteOptions};
use veni_light::Error;
use veni_light::light::{EnvironmentMap, LightOptions};
use veni_light::output::{self as files, Overwrite};
use veni_light::sphere::Equirect;

use crate::args::{Decoding, Force, Layer};
use crate::numbers::positive;
use crate::output::{self, SCENE, with_remedy};
use crate::piped;
use crate::printable::printable;
use crate::report::{Outcome, Report};
use crate::size::Size;
use crate::source::{self, Named, Radiance};
use choice::Sun;
use convention::Convention;

/// Where a latent is decoded, unless another size is asked for.
const DECODED: (usize, usize) = (512, 256);

/// Find the sun and other lights of a panorama or a latent: direction, irradiance, harmonics
#[derive(Args, Debug)]
#[command(
    group = ArgGroup::new("light").required(true),
    long_about = "Find the sun and other lights of a panorama or a latent: direction, irradiance, harmonics.\n\n\
        Lights are small parts of the sphere that outshine what surrounds them: the sun, the moon, lamps, windows; at \
        most eight, strongest first, the sun before all. Each has its direction, its irradiance E at normal incidence \
        (R G B, in the file's unit times steradian), its angular radius and its share of the light on a surface that \
        faces it. What is left is the residual: it has no sun in it, and together with the lights exactly the energy of \
        the whole.\n\n\
        A disc is less than 1.5 degrees in radius, a glow up to 6, a lobe wider: most latents show the sun as a lobe. \
        --sun-radius makes it a disc of the same energy, and --sharpened writes the panorama with it. A radius that the \
        pixels are too coarse to show is the sun's true one, 0.2665 degrees, and said to be assumed.",
    after_help = "Directions are of the native frame: z up, the middle of a panorama at +x, its left quarter at +y; azimuth \
        turns from +x to +y. JSON (one line): sun and lights, the first nine harmonics of radiance of the whole and of the \
        residual (orthonormal, with the Condon-Shortley sign), the mean radiance, and the irradiance of surfaces that \
        face up, down and four ways.\n\n\
        A picture has no unit that tells the full moon from the sun: at night the moon is called the sun.\n\n\
        Examples:\n  \
        veni-cli light sky.exr\n  \
        veni-cli light sky.exr --json | jq .sun.direction\n  \
        veni-cli light sky.exr --residual without_sun.exr -o light.json\n  \
        veni-cli light --seed 19 --sun-radius 0.2665 --size 2048 --sharpened sharp.exr\n  \
        veni-cli light sky.exr --sh three            for three.js' LightProbe"
)]
pub(crate) struct Light {
    /// An HDR panorama or baked image (its pixels are used), or a latent file; - is standard input
    #[arg(group = "light", value_name = "PANORAMA|LATENT")]
    input: Option<PathBuf>,

    /// A random sky from the model's prior, named by a number
    #[arg(long, short, value_name = "S", group = "light")]
    seed: Option<u64>,

    /// Which light is the sun: auto (the strongest above the horizon that looks like one), sky (the strongest above the
    /// horizon), any (the strongest), AZIMUTH,ELEVATION in degrees (what is brightest near there), or none (and no lights)
    #[arg(long, value_name = "auto|sky|any|none|AZ,EL", default_value = "auto", allow_hyphen_values = true)]
    sun: Sun,

    /// Make the sun a disc of this angular radius, with the same energy
    #[arg(long, value_name = "DEGREES", value_parser = positive)]
    sun_radius: Option<f64>,

    /// Write the panorama without the lights; - is standard output
    #[arg(long, value_name = "OUT.exr")]
    residual: Option<PathBuf>,

    /// Write the panorama with every light as a disc of its radius; - is standard output
    #[arg(long, value_name = "OUT.exr")]
    sharpened: Option<PathBuf>,

    /// Also print the harmonics as an engine reads them
    #[arg(long, value_enum, value_name = "CONVENTION")]
    sh: Option<Convention>,

    /// Also print illuminance in lux, one unit of the file being CD cd/m² [default: 1000 for what 'veni-cli synth' made, 1
    /// for other files]
    #[arg(long, value_name = "CD", num_args = 0..=1, value_parser = positive)]
    #[allow(clippy::option_option, reason = "a flag that may have a value")]
    lux: Option<Option<f64>>,

    /// Write the JSON to a file; - is standard output
    #[arg(long, short, value_name = "OUT.json")]
    output: Option<PathBuf>,

    /// Width at which a latent is decoded [default: 512]
    #[arg(long, value_name = "W")]
    size: Option<Size>,

    #[command(flatten)]
    layer: Layer,

    #[command(flatten)]
    decoding: Decoding,

    #[command(flatten)]
    force: Force,
}

impl Light {
    pub(crate) fn run(mut self, report: Report) -> Result<Outcome> {
        self.residual = piped::output_if(self.residual.as_deref(), "exr")?;
        self.sharpened = piped::output_if(self.sharpened.as_deref(), "exr")?;
        self.output = piped::output_if(self.output.as_deref(), "json")?;
        let overwrite = Overwrite::from(self.force);
        let images: Vec<_> = self.residual.iter().chain(&self.sharpened).cloned().collect();
        output::check(&images, &["exr", "hdr"], overwrite)?;
        output::check(self.output.as_slice(), &["json"], overwrite)?;
        let size = self.size.map(Size::equirect).transpose()?;
        let (width, height) = size.unwrap_or(DECODED);
        let input = piped::input_if(self.input.as_deref())?;
        let named = Named::new(input.as_deref(), self.seed)?;
        let grid = Equirect::new(width, height);
        let found = source::radiance(named, &self.layer, &self.decoding, grid, report)?;
        let Radiance { name, panorama, decoded } = found;
        if !decoded && size.is_some() {
            bail!("{name}: a panorama is looked at as it is; --size is for what is decoded from a latent");
        }
        // generated scenes are in kcd/m²
        let unit = if panorama.attributes().contains_key(SCENE) { 1000.0 } else { 1.0 };
        let options = LightOptions {
            sun: self.sun.0,
            sun_radius: self.sun_radius.map(|r| r.to_radians() as f32),
            ..LightOptions::default()
        };
        let grid = panorama.grid();
        let light = options.of_pixels(grid, panorama.into_pixels()).map_err(|e| e.in_file(&name))?;
        if self.sun.is_asked() && light.sun().is_none() {
            bail!(
                "{name}: nothing there is brighter than what surrounds it, so there is no sun; name another place with --sun"
            );
        }
        if self.sun_radius.is_some() && light.sun().is_none() {
            report.note(format_args!(
                "{name}: no sun was found; --sun-radius changes nothing (--sun sky takes the strongest light)"
            ));
        }
        let lux = self.lux.map(|cd| cd.unwrap_or(unit));
        let value = print::json(&light, self.sh, lux);
        if let Some(path) = &self.residual {
            write(path, light.residual(), overwrite)?;
        }
        if let Some(path) = &self.sharpened {
            let pixels = light.sharpened();
            let map = EnvironmentMap::new(grid, &pixels).map_err(|e| e.in_file(path))?;
            write(path, map, overwrite)?;
        }
        if let Some(path) = &self.output {
            let mut line = serde_json::to_vec(&value)?;
            line.push(b'\n');
            let write = |file: &mut dyn std::io::Write| file.write_all(&line);
            files::write_atomic(path, overwrite, |file| write(file).map_err(|e| Error::io(path, "write", e)))
                .map_err(with_remedy)?;
        }
        report.table(&print::text(&printable(&name), &light, self.sh, lux), &value)?;
        Ok(Outcome::Fine)
    }
}

/// In single precision: a disc may be beyond the range of half.
fn write(path: &Path, map: EnvironmentMap<'_>, overwrite: Overwrite) -> Result<()> {
    let hdr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hdr"));
    let format = if hdr { WriteFormat::Hdr } else { WriteFormat::Exr(Precision::Float) };
    let options = WriteOptions { overwrite, ..WriteOptions::new(format) };
    Panorama::new(map.grid(), map.pixels().to_vec()).write(path, &options).map_err(with_remedy)
}
