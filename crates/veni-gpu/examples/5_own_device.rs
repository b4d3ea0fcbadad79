//! The decoder inside a renderer that owns everything: instance, adapter, device with WebGPU's default limits, error
//! handler, cube map, command encoder and submission are all the host's.
//!
//! ```sh
//! cargo run --release -p veni-gpu --example 5_own_device            # --seed 7 | --latent FILE, --model FILE
//! ```
//!
//! Every frame the sky rotates by 30 degrees. One command encoder takes two passes: veni bakes the rotated light into the
//! host's cube map, and the host's own pass samples that cube map to compute an ambient cube, the irradiance of a
//! surface towards each of the six axes (G. McTaggart, "Half-Life 2 / Valve Source Shading"). The sun and other compact lights
//! of the code are lights of the host's own, as in any rasteriser: a thousand samples would miss a sun or take it for many. The
//! cube map is without them, and the host adds their irradiance. The numbers are compared with the same sums over the
//! field on the CPU, and after 90 degrees each face of the cube map must hold the texels of its neighbour.

use std::f64::consts::TAU;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use veni_gpu::wgpu::{self, BufferUsages, TextureUsages};
use veni_gpu::{Bake, GpuDecoder, read_back};
use veni_light::field::Field;
use veni_light::latent::Latent;
use veni_light::light::Lights;
use veni_light::model::Model;
use veni_light::sphere::Frame;

type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// Texels along an edge of the cube map. The light is smooth: 64 leave a fraction of a percent.
const FACE: u32 = 64;
/// Directions per axis, as in the shader below.
const DIRECTIONS: u32 = 1024;
const AXES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];

/// The host's own pass: a workgroup per axis averages a cosine-weighted spiral of directions around it.
const AMBIENT_CUBE: &str = "
@group(0) @binding(0) var sky: texture_cube<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;
@group(0) @binding(2) var<storage, read_write> irradiance: array<vec4f>;
// The compact lights: direction, then irradiance at normal incidence
@group(0) @binding(3) var<uniform> lights: array<vec4f, 16>;

const DIRECTIONS: u32 = 1024u;
var<workgroup> sums: array<vec3f, 64>;

// sin, cos of the azimuth and sin, cos of the polar angle from the axis
fn around(axis: u32, azimuth: vec2f, polar: vec2f) -> vec3f {
    let d = vec3f(polar.y * select(1.0, -1.0, (axis & 1u) == 1u), polar.x * azimuth.y, polar.x * azimuth.x);
    switch axis / 2u {
        case 0u: { return d; }
        case 1u: { return d.zxy; }
        default: { return d.yzx; }
    }
}

@compute @workgroup_size(64)
fn ambient_cube(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) index: u32) {
    var sum = vec3f();
    for (var i = index; i < DIRECTIONS; i += 64u) {
        let z2 = (f32(i) + 0.5) / f32(DIRECTIONS);
        let turns = fract(f32(i) * 0.61803399);
        let azimuth = vec2f(sin(6.2831853 * turns), cos(6.2831853 * turns));
        let direction = around(group.x, azimuth, vec2f(sqrt(1.0 - z2), sqrt(z2)));
        sum += textureSampleLevel(sky, smooth_sampler, direction, 0.0).rgb;
    }
    sums[index] = sum;
    workgroupBarrier();
    if index == 0u {
        for (var i = 1u; i < 64u; i++) {
            sum += sums[i];
        }
        var all = sum * 3.1415927 / f32(DIRECTIONS);
        let normal = around(group.x, vec2f(0.0, 1.0), vec2f(0.0, 1.0));
        for (var m = 0u; m < 16u; m += 2u) {
            all += lights[m + 1u].xyz * max(dot(normal, lights[m].xyz), 0.0);
        }
        irradiance[group.x] = vec4f(all, 1.0);
    }
}
";

fn main() -> Result<()> {
    let (model, sky) = arguments()?;
    let model = Model::load(&model)?;

    // The host's world: default limits, no optional features, and a handler that must never hear of anything, because
    // veni hands all errors back as values.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
    let uncaptured = Arc::new(AtomicU32::new(0));
    let count = Arc::clone(&uncaptured);
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        eprintln!("uncaptured: {error}");
        count.fetch_add(1, Ordering::Relaxed);
    }));
    eprintln!("{}", adapter.get_info().name);

    // the host's cube map: any texture of this format and usage
    let cube = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("sky"),
        size: wgpu::Extent3d { width: FACE, height: FACE, depth_or_array_layers: 6 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let host = Host::new(&device, &cube);

    // veni's part: the weights once, the latent once; both stay where they are from here on
    let latent = match sky {
        Sky::Seed(seed) => Latent::from_seed(&model.prior(), seed),
        Sky::File(path) => Latent::load(path)?,
    };
    let decoder = GpuDecoder::new(&device, &model)?;
    let latents = decoder.condition(&queue, &latent)?;
    // the host draws in glTF's frame, y up; its lookup vectors then need no conversion
    let bake = Bake::cube(&cube).frame(Frame::Gltf).without_lights();
    // compiles now instead of in the first frame
    decoder.prepare(&latents, &bake)?;

    let field = model.decoder()?.condition(&latent)?;
    let mut out = std::io::stdout();
    let (mut worst, mut unrotated) = (0f32, Vec::new());
    for step in 0..=3 {
        let angle = TAU / 12.0 * f64::from(step);
        // a few kilobytes into the same buffer, and the lights, which rotate with the rest
        decoder.update(&queue, &latents, 0, &[latent.rotated(angle)])?;
        host.set_lights(&queue, field.rotated(angle).lights());

        // one encoder: the light, then what the host does with it; one submission, by the host
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        decoder.bake(&mut encoder, &latents, &bake)?;
        host.ambient_cube(&mut encoder);
        queue.submit([encoder.finish()]);

        // only to print it: a renderer goes on on the device
        let found = read_back::buffer(&device, &queue, &host.irradiance)?;
        let expected = ambient_cube(&field.rotated(angle));
        writeln!(
            out,
            "rotated by {:.0} degrees: irradiance, and its relative difference from the CPU",
            angle.to_degrees()
        )?;
        for ((axis, found), expected) in AXES.iter().zip(&found).zip(&expected) {
            let difference = largest_difference(found, expected);
            worst = worst.max(difference);
            let [r, g, b] = found;
            writeln!(out, "  {axis}  {r:.4} {g:.4} {b:.4}  {difference:.1e}")?;
        }
        if step == 0 {
            unrotated = read_back::texture(&device, &queue, &cube)?;
        }
    }

    // Native +x is glTF's +x, native +y is glTF's -z: a quarter turn moves the light of face +x to -z, -x, +z and back.
    let rotated = read_back::texture(&device, &queue, &cube)?;
    let face =
        |texels: &[[f32; 3]], face: usize| texels[face * texels.len() / 6..][..texels.len() / 6].to_vec();
    let mut moved = 0f32;
    for (from, to) in [(0, 5), (5, 1), (1, 4), (4, 0)] {
        for (found, expected) in face(&rotated, to).iter().zip(&face(&unrotated, from)) {
            moved = moved.max(largest_difference(found, expected));
        }
    }
    writeln!(out, "largest difference from the CPU: {worst:.1e}")?;
    writeln!(out, "after a quarter turn each face holds its neighbour's texels, but for {moved:.1e}")?;
    let uncaptured = uncaptured.load(Ordering::Relaxed);
    writeln!(out, "errors that reached the host's handler: {uncaptured}")?;
    if worst >= 0.02 || moved >= 0.005 || uncaptured > 0 {
        return Err("the cube map does not hold the light of the field".into());
    }
    Ok(())
}

/// The host's pass and what it needs.
struct Host {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    irradiance: wgpu::Buffer,
    lights: wgpu::Buffer,
}

impl Host {
    fn new(device: &wgpu::Device, cube: &wgpu::Texture) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("ambient cube"),
            source: wgpu::ShaderSource::Wgsl(AMBIENT_CUBE.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("ambient cube"),
            layout: None,
            module: &module,
            entry_point: Some("ambient_cube"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let irradiance = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("ambient cube"),
            size: 6 * 16,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let lights = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("lights"),
            size: 32 * Lights::MOST as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let view = cube.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::Cube),
            ..wgpu::TextureViewDescriptor::default()
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let resources = [
            wgpu::BindingResource::TextureView(&view),
            wgpu::BindingResource::Sampler(&sampler),
            irradiance.as_entire_binding(),
            lights.as_entire_binding(),
        ];
        let entries = (0..).zip(resources);
        let entries: Vec<_> =
            entries.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ambient cube"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Self { pipeline, group, irradiance, lights }
    }

    /// The lights as the shader reads them, in glTF's frame; the rest is black.
    fn set_lights(&self, queue: &wgpu::Queue, lights: &Lights) {
        let mut words = [[0.0; 4]; 2 * Lights::MOST];
        for (words, light) in words.as_chunks_mut::<2>().0.iter_mut().zip(lights.iter()) {
            // of what a surface receives that a point would send, a disc of radius r sends cos²(r/2)
            let seen = (0.5 * light.radius).cos().powi(2);
            let [r, g, b] = light.irradiance.map(|e| e * seen);
            let [x, y, z] = Frame::Gltf.from_native(light.direction);
            *words = [[x, y, z, 0.0], [r, g, b, 0.0]];
        }
        queue.write_buffer(&self.lights, 0, bytemuck::cast_slice(&words));
    }

    fn ambient_cube(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(6, 1, 1);
    }
}

/// What the shader computes, from the field itself: no cube map, no half precision; its lights by their irradiance.
fn ambient_cube(field: &Field) -> Vec<[f32; 3]> {
    let mut radiance = vec![[0.0; 3]; DIRECTIONS as usize];
    let (lights, field) = (field.lights(), field.without_lights());
    let of = |axis| {
        let directions: Vec<_> = (0..DIRECTIONS).map(|i| Frame::Gltf.to_native(direction(axis, i))).collect();
        field.radiance_batch(&directions, &mut radiance);
        let sum = |channel: usize| radiance.iter().map(|rgb| f64::from(rgb[channel])).sum::<f64>();
        let normal = Frame::Gltf.to_native(towards(axis, [1.0, 0.0, 0.0]));
        lights.iter().fold(
            [0, 1, 2].map(|channel| (sum(channel) * TAU / 2.0 / f64::from(DIRECTIONS)) as f32),
            |sum, light| {
                let more = light.irradiance_on(normal);
                [0, 1, 2].map(|c| sum[c] + more[c])
            },
        )
    };
    (0..6).map(of).collect()
}

/// The i-th direction around an axis, as in the shader.
fn direction(axis: usize, i: u32) -> [f32; 3] {
    let z2 = (f64::from(i) + 0.5) / f64::from(DIRECTIONS);
    let (sin, cos) = (TAU * (f64::from(i) * 0.618_033_988_75).fract()).sin_cos();
    let r = (1.0 - z2).sqrt();
    towards(axis, [z2.sqrt(), r * cos, r * sin].map(|v| v as f32))
}

/// A vector whose first component is along an axis.
fn towards(axis: usize, [x, y, z]: [f32; 3]) -> [f32; 3] {
    let x = if axis % 2 == 1 { -x } else { x };
    match axis / 2 {
        0 => [x, y, z],
        1 => [z, x, y],
        _ => [y, z, x],
    }
}

/// Over the channels, relative to the brightest; a NaN counts as infinite.
fn largest_difference(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    let scale = b.iter().copied().fold(0.0, f32::max);
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs() / scale);
    differences.fold(0.0, |worst, d| if d.is_nan() { f32::INFINITY } else { d.max(worst) })
}

enum Sky {
    Seed(u64),
    File(PathBuf),
}

fn arguments() -> Result<(PathBuf, Sky)> {
    let mut model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../veni-light/assets/veni-27.safetensors");
    let mut sky = Sky::Seed(7);
    let mut args = std::env::args().skip(1);
    while let Some(name) = args.next() {
        let value = args.next().ok_or_else(|| format!("{name} needs a value"))?;
        match name.as_str() {
            "--model" => model = value.into(),
            "--seed" => {
                sky = Sky::Seed(value.parse().map_err(|_| format!("--seed {value}: not a whole number"))?);
            }
            "--latent" => sky = Sky::File(value.into()),
            _ => {
                return Err(format!(
                    "unknown argument {name}; 5_own_device [--seed S | --latent FILE] [--model FILE]"
                )
                .into());
            }
        }
    }
    Ok((model, sky))
}
