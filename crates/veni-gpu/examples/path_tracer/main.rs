//! A path tracer that is lit by the field and by nothing else: no environment map is ever made. Its miss shader calls
//! `veni_radiance(direction)`, which comes as WGSL text, once per path.
//!
//! ```sh
//! cargo run --release -p veni-gpu --example path_tracer -- --seed 7 -o spheres.png
//! cargo run --release -p veni-gpu --example path_tracer -- --seed 3 --size 1280x720 --samples 256 -o large.png
//! ```
//!
//! What a renderer takes over is in `Tracer::new`: the text, three buffers, nothing else. The rest is an ordinary path
//! tracer (`tracer.wgsl`) that shows what one does with a light that is a function:
//!
//! - Diffuse surfaces draw half of their directions from a coarse table of the sky's luminance, which the field on the
//!   CPU fills in a moment. The skies have no point-like sun, so nothing needs to be clamped against bright dots.
//! - The latent is turned so that the light comes from where it suits the scene; `--turn DEGREES` turns it otherwise.
//!
//! The defaults are for adapters in software, such as Mesa's lavapipe. It compiles the network for some ten seconds the
//! first time (then Mesa remembers it), and traces some thousand paths per second.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use veni_gpu::adapters::{self, Opened};
use veni_gpu::shader::{self, Weights};
use veni_gpu::wgpu::{self, BufferUsages};
use veni_gpu::{GpuDecoder, GpuLatents, read_back};
use veni_image::{luminance, tonemap::srgb};
use veni_light::field::Field;
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

const USAGE: &str =
    "path_tracer [--seed S] [--size WxH] [--samples N] [--turn DEGREES] [--model FILE] [-o FILE.png]";

/// Paths of a submission: work in small portions, so that no driver's watchdog takes it for a hang.
const PATHS: u32 = 1 << 17;
/// Side of a workgroup in `tracer.wgsl`.
const TILE: u32 = 8;
/// The table of light in `tracer.wgsl` is the upper half of this grid.
const LIGHT: Equirect = Equirect { width: 64, height: 32 };
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

    let model = Model::load(&options.model)?;
    let latent = Latent::from_seed(&model.prior(), options.seed);
    let field = model.decoder()?.condition(&latent)?;
    // turning the latent turns the light, exactly
    let turn =
        options.turn.map_or_else(|| KEY_LIGHT.to_radians() - azimuth_of_light(&field), f64::to_radians);

    // all that a host does to have the model on its device
    let decoder = GpuDecoder::new(&opened.device, &model)?;
    let latents = decoder.condition(&opened.queue, &latent.turned(turn))?;

    let tracer = Tracer::new(&opened, &decoder, &latents, &light_table(&field.turned(turn)), &options);
    let radiance = tracer.trace()?;
    write_png(&options, &radiance)?;
    writeln!(std::io::stdout(), "{}", options.out.display())?;
    Ok(())
}

/// Pipeline and bindings of one picture.
struct Tracer<'a> {
    opened: &'a Opened,
    size: [u32; 2],
    samples: u32,
    pipeline: wgpu::ComputePipeline,
    field: wgpu::BindGroup,
    scene: wgpu::BindGroup,
    view: wgpu::Buffer,
    picture: wgpu::Buffer,
}

impl<'a> Tracer<'a> {
    fn new(
        opened: &'a Opened,
        decoder: &GpuDecoder,
        latents: &GpuLatents,
        light: &[f32],
        options: &Options,
    ) -> Self {
        let Opened { device, queue, .. } = opened;

        // the shader: the field's function, its bindings in group 0, and the host's own text
        let enable = if decoder.weights() == Weights::Half { "enable f16;\n" } else { "" };
        let source = [
            enable,
            &shader::field_bindings(0, 0, decoder.weights()),
            &shader::field(decoder.sizes()),
            include_str!("tracer.wgsl"),
        ];
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("path tracer"),
            source: wgpu::ShaderSource::Wgsl(source.concat().into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("path tracer"),
            layout: None,
            module: &module,
            entry_point: Some("trace"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let group = |index: u32, buffers: &[&wgpu::Buffer]| {
            let entries = (0..).zip(buffers);
            let entries: Vec<_> = entries
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("path tracer"),
                layout: &pipeline.get_bind_group_layout(index),
                entries: &entries,
            })
        };
        let field = group(0, &[decoder.matrices(), decoder.vectors(), latents.buffer()]);

        // the tracer's own buffers
        let buffer = |size: usize, usage: BufferUsages| {
            let (size, label) = (size as u64, Some("path tracer"));
            device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
        };
        let filled = |bytes: &[u8]| {
            let buffer = buffer(bytes.len(), BufferUsages::STORAGE | BufferUsages::COPY_DST);
            queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let spheres = filled(bytemuck::cast_slice(&SPHERES.map(Sphere::words)));
        let light = filled(bytemuck::cast_slice(light));
        let view = buffer(4 * VIEW_WORDS, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
        // new buffers hold zeros
        let pixels = options.size[0] as usize * options.size[1] as usize;
        let picture = buffer(16 * pixels, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let scene = group(1, &[&view, &spheres, &light, &picture]);

        let Options { size, samples, .. } = *options;
        Self { opened, size, samples, pipeline, field, scene, view, picture }
    }

    /// Adds one path per pixel after the other; the mean of them all.
    fn trace(&self) -> Result<Vec<[f32; 3]>> {
        let [width, height] = self.size;
        let rows = (PATHS / width / TILE * TILE).max(TILE);
        let started = Instant::now();
        for sample in 0..self.samples {
            for first_row in (0..height).step_by(rows as usize) {
                self.submit(sample, first_row, rows.min(height - first_row));
                self.opened.device.poll(wgpu::PollType::wait_indefinitely())?;
            }
            eprint!("\r{} of {} samples, {:.1} s", sample + 1, self.samples, started.elapsed().as_secs_f64());
        }
        let paths = f64::from(self.samples) * f64::from(width) * f64::from(height);
        eprintln!(", {:.0} paths/s", paths / started.elapsed().as_secs_f64());
        let sums = read_back::buffer(&self.opened.device, &self.opened.queue, &self.picture)?;
        Ok(sums.into_iter().map(|rgb| rgb.map(|v| v / self.samples as f32)).collect())
    }

    fn submit(&self, sample: u32, first_row: u32, rows: u32) {
        let Opened { device, queue, .. } = self.opened;
        queue.write_buffer(&self.view, 0, bytemuck::cast_slice(&self.view(sample, first_row)));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.field, &[]);
        pass.set_bind_group(1, &self.scene, &[]);
        pass.dispatch_workgroups(self.size[0].div_ceil(TILE), rows.div_ceil(TILE), 1);
        drop(pass);
        queue.submit([encoder.finish()]);
    }

    /// The uniform `View` of `tracer.wgsl`.
    fn view(&self, sample: u32, first_row: u32) -> [u32; VIEW_WORDS] {
        let [width, height] = self.size;
        let sub = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let unit = |a: [f32; 3]| a.map(|v| v / a.iter().map(|v| v * v).sum::<f32>().sqrt());
        let cross = |a: [f32; 3], b: [f32; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let forward = unit(sub(LOOK_AT, EYE));
        let right = unit(cross(forward, [0.0, 0.0, 1.0]));
        let up = cross(right, forward);
        let row = |v: [f32; 3], w: u32| [v[0].to_bits(), v[1].to_bits(), v[2].to_bits(), w];
        let words = [
            row(EYE, 0),
            row(forward, sample),
            row(right.map(|v| v * HALF_WIDTH), first_row),
            row(up.map(|v| v * HALF_WIDTH * height as f32 / width as f32), width),
            [height, 0, 0, 0],
        ];
        bytemuck::cast(words)
    }
}

const VIEW_WORDS: usize = 20;

/// The camera, in the native frame: z up, units as you like.
const EYE: [f32; 3] = [-9.0, 0.6, 1.5];
const LOOK_AT: [f32; 3] = [0.0, 0.0, 1.2];
/// Tangent of half the horizontal angle of view.
const HALF_WIDTH: f32 = 0.39;

/// What a sphere is made of; the numbers stand in `tracer.wgsl`.
#[derive(Clone, Copy)]
enum Material {
    Diffuse = 0,
    Metal = 1,
    Glass = 2,
    Coated = 3,
}

/// A sphere that stands on the ground.
#[derive(Clone, Copy)]
struct Sphere {
    at: [f32; 2],
    radius: f32,
    colour: [f32; 3],
    roughness: f32,
    material: Material,
}

const SPHERES: [Sphere; 8] = [
    ball([0.6, 0.0], 1.15, [0.96, 0.96, 0.97], 0.0, Material::Metal),
    ball([0.2, 2.25], 0.9, [1.0, 0.78, 0.34], 0.45, Material::Metal),
    ball([0.2, -2.25], 0.9, [0.98, 0.99, 1.0], 0.0, Material::Glass),
    ball([-1.7, 1.15], 0.4, [0.62, 0.07, 0.05], 0.1, Material::Coated),
    ball([-2.1, 0.1], 0.33, [0.8, 0.8, 0.8], 0.0, Material::Diffuse),
    ball([-1.7, -0.95], 0.4, [0.05, 0.14, 0.5], 0.1, Material::Coated),
    ball([2.9, 1.75], 0.55, [0.1, 0.1, 0.11], 0.2, Material::Coated),
    ball([2.7, -1.5], 0.6, [0.1, 0.34, 0.12], 0.0, Material::Diffuse),
];

const fn ball(at: [f32; 2], radius: f32, colour: [f32; 3], roughness: f32, material: Material) -> Sphere {
    Sphere { at, radius, colour, roughness, material }
}

impl Sphere {
    /// As `tracer.wgsl` declares it.
    fn words(self) -> [u32; 12] {
        let Self { at: [x, y], radius, colour: [r, g, b], roughness, material } = self;
        let numbers = [x, y, radius, radius, r, g, b, roughness].map(f32::to_bits);
        let mut words = [0; 12];
        words[..8].copy_from_slice(&numbers);
        words[8] = material as u32;
        words
    }
}

/// Where the light is, for sampling: the probability that a cell of the sky's upper half comes before the i-th.
fn light_table(field: &Field) -> Vec<f32> {
    let mut sum = 0.0;
    let mut sums = vec![0.0];
    for (row, pixels) in field.bake(LIGHT).chunks_exact(LIGHT.width).take(LIGHT.height / 2).enumerate() {
        for &pixel in pixels {
            sum += f64::from(luminance(pixel)) * LIGHT.solid_angle(row);
            sums.push(sum);
        }
    }
    sums.iter().map(|s| (s / sum) as f32).collect()
}

/// Azimuth that most light comes from: that of the upper half's mean direction, weighted by luminance.
fn azimuth_of_light(field: &Field) -> f64 {
    let (mut x, mut y) = (0.0, 0.0);
    for (i, pixel) in field.bake(LIGHT).into_iter().take(LIGHT.len() / 2).enumerate() {
        let (column, row) = (i % LIGHT.width, i / LIGHT.width);
        let weight = f64::from(luminance(pixel)) * LIGHT.solid_angle(row);
        let direction = LIGHT.direction(column, row);
        x += weight * f64::from(direction[0]);
        y += weight * f64::from(direction[1]);
    }
    y.atan2(x)
}

/// Exposes by the geometric mean of the picture, bends it by ACES' curve (K. Narkowicz' fit), and writes 8-bit sRGB.
fn write_png(options: &Options, radiance: &[[f32; 3]]) -> Result<()> {
    let logs: f64 = radiance.iter().map(|&rgb| f64::from(luminance(rgb).max(1e-6)).ln()).sum();
    let exposure = 0.20 / (logs / radiance.len() as f64).exp() as f32;
    let aces = |v: f32| v * (2.51 * v + 0.03) / (v * (2.43 * v + 0.59) + 0.14);
    let byte = |v: f32| (255.0 * srgb(aces(exposure * v).clamp(0.0, 1.0)) + 0.5) as u8;
    let pixels: Vec<[u8; 3]> = radiance.iter().map(|rgb| rgb.map(byte)).collect();

    let [width, height] = options.size;
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(&options.out)?), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(())
}

struct Options {
    seed: u64,
    size: [u32; 2],
    samples: u32,
    turn: Option<f64>,
    model: PathBuf,
    out: PathBuf,
}

impl Options {
    fn from_args() -> Result<Self> {
        let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../veni-light/assets/veni-27.safetensors");
        let out = PathBuf::from("path_tracer.png");
        let mut options = Self { seed: 7, size: [192, 108], samples: 16, turn: None, model, out };
        let mut args = std::env::args().skip(1);
        while let Some(name) = args.next() {
            if !["--seed", "--size", "--samples", "--turn", "--model", "-o"].contains(&name.as_str()) {
                return Err(format!("unknown argument {name}; {USAGE}").into());
            }
            let value = args.next().ok_or_else(|| format!("{name} needs a value; {USAGE}"))?;
            let wrong = || format!("{name} {value}: not of the right form; {USAGE}");
            match name.as_str() {
                "--seed" => options.seed = value.parse().map_err(|_| wrong())?,
                "--size" => {
                    let (width, height) = value.split_once('x').ok_or_else(wrong)?;
                    let side = |text: &str| text.parse::<u32>().map_err(|_| wrong());
                    options.size = [side(width)?, side(height)?];
                }
                "--samples" => options.samples = value.parse().map_err(|_| wrong())?,
                "--turn" => options.turn = Some(value.parse().map_err(|_| wrong())?),
                "--model" => options.model = value.into(),
                _ => options.out = value.into(),
            }
        }
        if options.size.contains(&0) || options.samples == 0 {
            return Err("a picture needs pixels and samples".into());
        }
        Ok(options)
    }
}
