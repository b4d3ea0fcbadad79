//! A path tracer that is lit by the field, or by a panorama, and samples that light.
//!
//! ```sh
//! cargo run --release -p veni-gpu --example path_tracer -- --seed 7 -o spheres.png
//! cargo run --release -p veni-gpu --example path_tracer -- --seed 3 --size 1280x720 --samples 256 -o large.png
//! cargo run --release -p veni-gpu --example path_tracer -- --panorama street.hdr --samples 64 --compare
//! ```
//!
//! What a renderer takes over is in `tracer.rs`: the texts, their buffers, nothing else. The rest is an ordinary path tracer
//! (`tracer.wgsl`):
//!
//! - **The sky** is a function: `veni_radiance(direction)`, the network itself with the lights of the code, which no environment map
//!   stands for, or `veni_light_radiance(direction)` of a panorama whose sun was made a disc of its own. It is asked once per path,
//!   for the sun and all else, so that the sun is counted once; `veni_sample_light` only says where to look.
//! - **Diffuse surfaces** draw directions by the cosine (`--sampler bsdf`), by `veni_sample_light` (`light`), or half of the
//!   time by either, with the mean of both densities (`mis`, the balance heuristic with one sample; the light is then sampled by
//!   what exceeds its mean). Light alone is right only where no direction is black.
//! - **The rotation**: light comes from where it suits the scene, `--turn DEGREES` rotates it otherwise: eight bytes for the sampler, a
//!   rotated latent for the field.
//!
//! `--compare` traces all three, twice each, with every surface diffuse (a mirror shows the sun whatever the sampler): the variance
//! of a picture is half the mean square of what two of them differ by, at equal samples, and at the time that `bsdf` takes for
//! them.
//!
//! The defaults are for adapters in software, such as Mesa's lavapipe. It compiles the network for some ten seconds the first
//! time (then Mesa remembers it), and traces some thousand paths per second; under a panorama some hundred thousand.

mod options;
mod picture;
mod scene;
mod tracer;

use std::io::Write;

use veni_gpu::adapters::{self, Opened};
use veni_gpu::shader::{LightDensity, pack_light};
use veni_gpu::{GpuDecoder, GpuLight};
use veni_image::{Panorama, luminance};
use veni_light::latent::Latent;
use veni_light::light::{CompactLight, EnvironmentMap, Kind, Light, Lights};
use veni_light::model::Model;
use veni_light::sphere::Equirect;

use options::{Options, Strategy};
use tracer::{Sky, Tracer};

pub(crate) type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// What the field's sampler is made of, beside the sun. The field is smooth: its pixels hold what a direction needs.
const GRID: Equirect = Equirect { width: 256, height: 128 };
/// Where most light comes from, degrees counter-clockwise from +x, where the camera looks: from the left, slightly
/// ahead.
const KEY_LIGHT: f64 = 70.0;

fn main() -> Result<()> {
    let options = Options::from_args()?;
    let found = pollster::block_on(adapters::list());
    let adapter = found.first().ok_or("no graphics adapter; on Linux, Mesa's lavapipe is one in software")?;
    // With everything it has, f16 weights included; software would only convert them. A host that renders has its own
    // device: see the example `5_own_device`.
    let opened = match adapter.is_software() {
        true => pollster::block_on(adapter.open_plain())?,
        false => pollster::block_on(adapter.open())?,
    };
    eprintln!("{opened}");
    let [width, height] = options.size.map(u64::from);
    let most = opened.device.limits().max_storage_buffer_binding_size;
    if 16 * width * height > most {
        return Err(
            format!("{width}x{height}: this device holds pictures of {} pixels at most", most / 16).into()
        );
    }
    let sky = sky(&opened, &options)?;
    let tracer = Tracer::new(&opened, &sky, &options);
    if options.compare {
        return compare(&tracer, &options);
    }
    let (radiance, _) = tracer.trace(options.strategy, options.samples, 0)?;
    picture::write_png(&options.out, options.size, &radiance)?;
    writeln!(std::io::stdout(), "{}", options.out.display())?;
    Ok(())
}

/// All that a host does to have a light on its device, and the model.
fn sky(opened: &Opened, options: &Options) -> Result<Sky> {
    let Opened { device, queue, .. } = opened;
    let (light, angle, field) = match &options.panorama {
        Some(path) => {
            let panorama = Panorama::read(path)?;
            let light = Light::of(panorama.environment()?);
            (light, key_rotation(panorama.environment()?), None)
        }
        None => {
            let model = Model::load(&options.model)?;
            let latent = match &options.latent {
                Some(path) => Latent::load(path)?,
                None => Latent::from_seed(&model.prior(), options.seed),
            };
            let field = model.decoder()?.condition(&latent)?;
            let angle = key_rotation(EnvironmentMap::new(GRID, &field.bake(GRID))?);
            // The sun of the code is drawn by its disc, which `veni_radiance` shows where `veni_sample_light` aims. The map holds the
            // rest: lamps, and glows better than discs.
            let is_sun =
                |light: &CompactLight| light.kind() == Kind::Disc && field.lights().sun() == Some(light);
            let (sun, others): (Vec<_>, Vec<_>) = field.lights().iter().copied().partition(is_sun);
            let rest = field.with_lights(Lights::new(None, others)).bake(GRID);
            let light = Light::of_parts(EnvironmentMap::new(GRID, &rest)?, sun.first().copied());
            (light, angle, Some((model, latent)))
        }
    };
    let angle = options.turn.map_or(angle, f64::to_radians);
    // packed once, rotated by eight bytes
    let upload = |density| -> Result<GpuLight> {
        let uploaded = GpuLight::new(device, &pack_light(&light, density)?)?;
        uploaded.rotate(queue, angle)?;
        Ok(uploaded)
    };
    let lights = [upload(LightDensity::Luminance)?, upload(LightDensity::Compensated)?];
    let field = match field {
        Some((model, latent)) => {
            let decoder = GpuDecoder::new(device, &model)?;
            // rotating the latent rotates the light, exactly
            let latents = decoder.condition(queue, &latent.rotated(angle))?;
            Some((decoder, latents))
        }
        None => None,
    };
    Ok(Sky { lights, field })
}

/// The rotation that brings most light to where it suits the scene: the azimuth of the upper half's mean direction,
/// weighted by luminance.
fn key_rotation(map: EnvironmentMap<'_>) -> f64 {
    let (grid, mut x, mut y) = (map.grid(), 0.0, 0.0);
    for (i, pixel) in map.pixels().iter().take(grid.len() / 2).enumerate() {
        let (column, row) = (i % grid.width, i / grid.width);
        let weight = f64::from(luminance(*pixel)) * grid.solid_angle(row);
        let direction = grid.direction(column, row);
        x += weight * f64::from(direction[0]);
        y += weight * f64::from(direction[1]);
    }
    KEY_LIGHT.to_radians() - y.atan2(x)
}

/// Variance of the strategies at equal samples and at equal time.
fn compare(tracer: &Tracer<'_>, options: &Options) -> Result<()> {
    let mut out = std::io::stdout();
    writeln!(out, "sampler  samples  seconds  mean luminance  variance / mean²")?;
    let mut line = |strategy: Strategy, samples: u32| -> Result<f64> {
        let (one, seconds) = tracer.trace(strategy, samples, 0)?;
        let (two, more) = tracer.trace(strategy, samples, 1)?;
        let [mean, variance] = picture::mean_and_variance(&one, &two);
        let (name, seconds) = (strategy.name(), 0.5 * (seconds + more));
        writeln!(out, "{name:<7}  {samples:>7}  {seconds:>7.2}  {mean:>14.5}  {variance:>16.3e}")?;
        picture::write_png(&options.out_of(strategy), options.size, &one)?;
        Ok(seconds)
    };
    let mut seconds = Vec::new();
    for strategy in Strategy::ALL {
        seconds.push(line(strategy, options.samples)?);
    }
    let allowed = seconds[0];
    for (strategy, seconds) in Strategy::ALL.into_iter().zip(&seconds).skip(1) {
        let samples = (f64::from(options.samples) * allowed / seconds).round().max(1.0) as u32;
        line(strategy, samples)?;
    }
    Ok(())
}
