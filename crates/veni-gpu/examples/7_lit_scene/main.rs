//! A scene lit by a sky on a wgpu device of one's own: background, prefiltered reflections, diffuse light, and the sun as a directional
//! light with a shadow map. What is loaded is a folder that `veni-cli ibl --engine any` writes; without one, the same is made here.
//!
//! ```sh
//! cargo run --release -p veni-gpu --example 7_lit_scene -- -o lit_scene.png
//! veni-cli ibl street.hdr --engine any -o sky
//! cargo run --release -p veni-gpu --example 7_lit_scene -- sky -o lit_scene.png
//! ```
//!
//! [`sky`] is what a renderer loads, [`renderer`] and `scene.wgsl` what it does with it; [`mesh`] and [`camera`] are the scene.
//!
//! Afterwards the light is measured: a white plane in the open must send up its irradiance over π, which is summed over the pixels
//! of the panorama, within 1 %; a metre from a pole it must be in the shade away from the sun, and not towards it. A sun of twice the
//! irradiance and a sun rotated by 90° must not pass.

mod camera;
mod mesh;
mod renderer;
mod sky;

use std::f32::consts::PI;
use std::io::Write;
use std::path::{Path, PathBuf};

use camera::{Camera, unit};
use mesh::{BALL_AT, BALL_RADIUS, Look, POLE_HEIGHT, WALLS, wall_at};
use renderer::Renderer;
use sky::Sky;
use veni_gpu::wgpu;
use veni_image::{luminance, tonemap::srgb};
use veni_light::output::Overwrite;

type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

const USAGE: &str = "7_lit_scene [FOLDER] [-o FILE.png] [--balls] [--exposure K] [--size WxH] [--json] [--sun X,Y,Z] [--raw FILE] [--mirror X,Y,Z]…";
/// The most that the plane may be off.
const BAR: f32 = 0.01;

fn main() -> Result<()> {
    let options = Options::from_args()?;
    let sky = options.folder.as_deref().map_or_else(Sky::made_here, Sky::load)?;

    // The host's own device, with WebGPU's default limits and no optional features.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
    eprintln!("{}", adapter.get_info().name);
    let renderer = Renderer::new(device, queue, &sky);

    if let Some(file) = &options.out {
        let [width, height] = options.size;
        // four samples per pixel
        let look = if options.balls { Look::Balls } else { Look::Picture };
        let large = renderer.render(&look, &Camera::picture(width, height), 2 * width, 2 * height, &sky)?;
        let pixels = halved(&large, width as usize);
        if let Some(raw) = &options.raw {
            std::fs::write(raw, bytemuck::cast_slice(&pixels))?;
        }
        let exposure = options.exposure.unwrap_or_else(|| by_the_median(&pixels));
        write_png(file, options.size, &pixels, exposure)?;
        eprintln!("{}, exposure {exposure}", file.display());
    }
    let towards = options.sun.or(sky.sun.as_ref().map(|sun| sun.direction)).unwrap_or([1.0, 0.0, 0.0]);
    let measured = Measured::of(&renderer, &sky, towards, &options.mirrors)?;
    let expected = sky.irradiance_of_the_ground().map(|e| e / PI);
    if options.json {
        let line = serde_json::json!({ "places": measured.places, "walls": measured.walls, "mirrors": measured.mirrors, "adapter": adapter.get_info().name });
        writeln!(std::io::stdout(), "{line}")?;
        return Ok(());
    }
    measured.print(expected)?;
    let Some(fault) = measured.fault(expected, sky.sun.is_some()) else {
        return still_notices(&renderer, &sky, towards, expected);
    };
    Err(fault.into())
}

/// What is wrong on purpose must be seen, or the measurement says nothing.
fn still_notices(renderer: &Renderer, sky: &Sky, towards: [f32; 3], expected: [f32; 3]) -> Result<()> {
    let Some(sun) = &sky.sun else { return Ok(()) };
    let [x, y, z] = sun.direction;
    let mut doubled = *sun;
    doubled.irradiance = sun.irradiance.map(|e| 2.0 * e);
    let mut rotated = *sun;
    rotated.direction = [z, y, -x];
    for (sun, what) in [(doubled, "twice as strong"), (rotated, "rotated")] {
        let wrong = Sky { sun: Some(sun), ..sky.clone() };
        let fault = Measured::of(renderer, &wrong, towards, &[])?.fault(expected, true);
        let fault = fault.ok_or_else(|| format!("a sun {what} is not noticed"))?;
        writeln!(std::io::stdout(), "a sun {what} is noticed: {fault}")?;
    }
    Ok(())
}

/// Radiance that white surfaces send along their normals.
struct Measured {
    /// The plane in the open; a metre from the pole away from the sun; a metre from it towards the sun.
    places: [[f32; 3]; 3],
    /// Walls far away that see the sky alone, without the sun.
    walls: [[f32; 3]; 4],
    /// A mirror, seen along some normals: the sky in these directions.
    mirrors: Vec<[f32; 3]>,
}

impl Measured {
    fn of(renderer: &Renderer, sky: &Sky, towards: [f32; 3], mirrors: &[[f32; 3]]) -> Result<Self> {
        let [x, _, z] = unit([towards[0], 0.0, towards[2]]);
        let without = Sky { sun: None, ..sky.clone() };
        let look = |at: [f32; 3], normal, sky| {
            let pixels = renderer.render(&Look::White, &Camera::near(at, normal), 4, 4, sky)?;
            let mean = [0, 1, 2].map(|c| pixels.iter().map(|p| p[c]).sum::<f32>() / pixels.len() as f32);
            Ok::<_, Box<dyn std::error::Error>>(mean)
        };
        let up = [0.0, 1.0, 0.0];
        let places = [[12.0, 0.0, 12.0], [-x, 0.0, -z], [x, 0.0, z]];
        let mut measured = Self { places: [[0.0; 3]; 3], walls: [[0.0; 3]; 4], mirrors: Vec::new() };
        for (place, found) in places.into_iter().zip(&mut measured.places) {
            *found = look(place, up, sky)?;
        }
        for (normal, found) in WALLS.into_iter().zip(&mut measured.walls) {
            *found = look(wall_at(normal), normal, &without)?;
        }
        for &normal in mirrors {
            let at = [0, 1, 2].map(|k| BALL_AT[k] + BALL_RADIUS * normal[k]);
            measured.mirrors.push(look(at, normal, &without)?);
        }
        Ok(measured)
    }

    fn print(&self, expected: [f32; 3]) -> Result<()> {
        let mut out = std::io::stdout();
        writeln!(out, "radiance of a white plane in the open: {:?}", self.places[0])?;
        writeln!(out, "irradiance of the ground over pi:      {expected:?}")?;
        writeln!(out, "off by {:.3} %", 100.0 * difference(self.places[0], expected))?;
        let [_, behind, before] = self.places.map(|p| luminance(p) / luminance(expected));
        writeln!(
            out,
            "a metre from a pole of {POLE_HEIGHT} m: {behind:.3} of it away from the sun, {before:.3} towards it"
        )?;
        Ok(())
    }

    fn fault(&self, expected: [f32; 3], sun: bool) -> Option<String> {
        let off = difference(self.places[0], expected);
        // a NaN is a fault too
        if off.is_nan() || off > BAR {
            return Some(format!("the plane is off by {:.2} %", 100.0 * off));
        }
        let [_, behind, before] = self.places.map(|p| luminance(p) / luminance(expected));
        // without a sun nothing casts a shadow in this renderer
        let right = if sun { behind < 0.99 && before > 0.99 } else { behind > 0.99 };
        (!right).then(|| format!("{behind:.3} of the light away from the sun, {before:.3} towards it"))
    }
}

/// Over the channels, relative.
fn difference(found: [f32; 3], expected: [f32; 3]) -> f32 {
    found
        .iter()
        .zip(expected)
        .map(|(a, b)| (a / b - 1.0).abs())
        .fold(0.0, |a, b| if b.is_nan() { b } else { b.max(a) })
}

/// Means of 2 × 2 pixels.
fn halved(pixels: &[[f32; 3]], width: usize) -> Vec<[f32; 3]> {
    let at = |row: usize, column: usize| pixels[row * 2 * width + column];
    (0..pixels.len() / 4)
        .map(|k| {
            let (row, column) = (2 * (k / width), 2 * (k % width));
            let four = [at(row, column), at(row, column + 1), at(row + 1, column), at(row + 1, column + 1)];
            [0, 1, 2].map(|c| four.iter().map(|p| p[c]).sum::<f32>() / 4.0)
        })
        .collect()
}

/// The exposure at which the median is a middle grey.
fn by_the_median(radiance: &[[f32; 3]]) -> f32 {
    let mut sorted: Vec<f32> = radiance.iter().map(|&p| luminance(p)).collect();
    sorted.sort_by(f32::total_cmp);
    0.35 / sorted[sorted.len() / 2].max(1e-6)
}

/// What is brighter than most is rolled off.
fn write_png(file: &Path, [width, height]: [u32; 2], radiance: &[[f32; 3]], exposure: f32) -> Result<()> {
    let curve = |v: f32| if v < 0.6 { v } else { 1.0 - 0.4 * (-(v - 0.6) / 0.4).exp() };
    let byte = |v: f32| (255.0 * srgb(curve(exposure * v)) + 0.5) as u8;
    let pixels: Vec<[u8; 3]> = radiance.iter().map(|p| p.map(byte)).collect();
    Ok(veni_image::write_png(file, [width as usize, height as usize], &pixels, Overwrite::Replace)?)
}

struct Options {
    folder: Option<PathBuf>,
    out: Option<PathBuf>,
    size: [u32; 2],
    /// Three balls.
    balls: bool,
    /// By which the picture is multiplied; by default what makes its median a middle grey.
    exposure: Option<f32>,
    /// Print numbers only, without judging them.
    json: bool,
    /// Where the sun should be, in the renderer's axes; by default where the sky has it.
    sun: Option<[f32; 3]>,
    /// The picture's radiance, f32.
    raw: Option<PathBuf>,
    /// Directions in which the mirror is looked at.
    mirrors: Vec<[f32; 3]>,
}

impl Options {
    fn from_args() -> Result<Self> {
        let mut options = Self {
            folder: None,
            out: None,
            size: [360, 270],
            balls: false,
            exposure: None,
            json: false,
            sun: None,
            raw: None,
            mirrors: Vec::new(),
        };
        let mut args = std::env::args().skip(1);
        while let Some(name) = args.next() {
            let mut value = || args.next().ok_or_else(|| format!("{name} needs a value; {USAGE}"));
            let wrong = |value: &str| format!("{value}: not of the right form; {USAGE}");
            match name.as_str() {
                "-o" => options.out = Some(value()?.into()),
                "--raw" => options.raw = Some(value()?.into()),
                "--json" => options.json = true,
                "--balls" => options.balls = true,
                "--exposure" => options.exposure = Some(value()?.parse()?),
                "--size" => {
                    let value = value()?;
                    let (width, height) = value.split_once('x').ok_or_else(|| wrong(&value))?;
                    options.size = [width.parse()?, height.parse()?];
                }
                "--sun" => options.sun = Some(direction(&value()?)?),
                "--mirror" => options.mirrors.push(direction(&value()?)?),
                _ if name.starts_with('-') => return Err(format!("unknown argument {name}; {USAGE}").into()),
                _ => options.folder = Some(name.into()),
            }
        }
        Ok(options)
    }
}

/// X,Y,Z in the renderer's axes.
fn direction(text: &str) -> Result<[f32; 3]> {
    let numbers: Vec<f32> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
    Ok(numbers.try_into().map_err(|_| format!("{text}: not X,Y,Z"))?)
}
