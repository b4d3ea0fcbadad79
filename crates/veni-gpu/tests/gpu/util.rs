//! Devices, models and comparisons that the tests share.

use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use veni_gpu::adapters::{self, Opened};
use veni_gpu::shader::Grid;
use veni_gpu::wgpu::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Extent3d, MapMode, PollType, Texture,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
};
use veni_gpu::{Bake, GpuDecoder, GpuLatents, read_back};
use veni_light::latent::{Latent, Prior};
use veni_light::model::{DecoderConfig, Model, ModelConfig};

/// A device for one test, or nothing if tests on GPUs are to be skipped.
pub(crate) struct Gpu {
    pub(crate) opened: Opened,
}

static SKIPPED: AtomicUsize = AtomicUsize::new(0);

/// Whether there is an adapter; says once which. Panics without one, unless that is known.
pub(crate) fn adapter() -> Option<&'static adapters::Found> {
    static FOUND: OnceLock<Option<adapters::Found>> = OnceLock::new();
    let found = FOUND.get_or_init(|| {
        let found = pollster::block_on(adapters::list()).into_iter().next();
        let name = found.as_ref().map_or_else(|| "none".to_owned(), ToString::to_string);
        say(&format!("adapter: {name}"));
        found
    });
    if found.is_none() {
        let known = std::env::var("VENI_SKIP_GPU").is_ok_and(|v| v == "1");
        assert!(
            known,
            "no graphics adapter: install a Vulkan driver (package mesa-vulkan-drivers), or set VENI_SKIP_GPU=1"
        );
        let count = 1 + SKIPPED.fetch_add(1, Ordering::Relaxed);
        say(&format!("no adapter and VENI_SKIP_GPU=1: {count} GPU tests skipped so far"));
    }
    found.as_ref()
}

/// Past the test framework's capture: what a green run ran on is seen too.
pub(crate) fn say(line: &str) {
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}

/// A device with WebGPU's default limits and no optional features.
pub(crate) fn plain() -> Option<Gpu> {
    adapter().map(|found| Gpu { opened: pollster::block_on(found.open_plain()).unwrap() })
}

/// A device with everything the adapter has and the decoder uses.
pub(crate) fn rich() -> Option<Gpu> {
    adapter().map(|found| Gpu { opened: pollster::block_on(found.open()).unwrap() })
}

impl Gpu {
    pub(crate) fn buffer(&self, size: u64, usage: BufferUsages) -> Buffer {
        let descriptor = BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        self.opened.device.create_buffer(&descriptor)
    }

    /// Room for `count` vec4f that can be written by a kernel and read back.
    pub(crate) fn pixels(&self, count: usize) -> Buffer {
        self.buffer(16 * count as u64, BufferUsages::STORAGE | BufferUsages::COPY_SRC)
    }

    pub(crate) fn upload(&self, directions: &[[f32; 3]]) -> Buffer {
        let data: Vec<_> = directions.iter().map(|[x, y, z]| [*x, *y, *z, f32::NAN]).collect();
        let buffer =
            self.buffer(16 * directions.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        self.opened.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&data));
        buffer
    }

    pub(crate) fn texture(&self, format: TextureFormat, [width, height, layers]: [u32; 3]) -> Texture {
        self.texture_with(format, [width, height, layers], TextureUsages::STORAGE_BINDING)
    }

    pub(crate) fn texture_with(
        &self,
        format: TextureFormat,
        [width, height, layers]: [u32; 3],
        usage: TextureUsages,
    ) -> Texture {
        self.opened.device.create_texture(&TextureDescriptor {
            label: None,
            size: Extent3d { width, height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: usage | TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    pub(crate) fn bake(&self, decoder: &GpuDecoder, latents: &GpuLatents, bake: &Bake<'_>) {
        let mut encoder = self.opened.device.create_command_encoder(&CommandEncoderDescriptor::default());
        decoder.bake(&mut encoder, latents, bake).unwrap();
        self.opened.queue.submit([encoder.finish()]);
    }

    /// Every vec4f of a buffer.
    pub(crate) fn read_all(&self, buffer: &Buffer) -> Vec<[f32; 4]> {
        let host = self.buffer(buffer.size(), BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let mut encoder = self.opened.device.create_command_encoder(&CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &host, 0, buffer.size());
        self.opened.queue.submit([encoder.finish()]);
        host.map_async(MapMode::Read, .., |result| result.unwrap());
        self.opened.device.poll(PollType::wait_indefinitely()).unwrap();
        let bytes = host.get_mapped_range(..).unwrap();
        bytemuck::cast_slice(&bytes).to_vec()
    }

    pub(crate) fn read(&self, buffer: &Buffer) -> Vec<[f32; 3]> {
        read_back::buffer(&self.opened.device, &self.opened.queue, buffer).unwrap()
    }

    pub(crate) fn read_texture(&self, texture: &Texture) -> Vec<[f32; 3]> {
        read_back::texture(&self.opened.device, &self.opened.queue, texture).unwrap()
    }

    /// Log radiance of a whole grid.
    pub(crate) fn log_radiance(&self, decoder: &GpuDecoder, latent: &Latent, grid: Grid) -> Vec<[f32; 3]> {
        let latents = decoder.condition(&self.opened.queue, latent).unwrap();
        let rows = match grid {
            Grid::Equirect { height, .. } => height,
            Grid::Cube { size } => 6 * size,
            Grid::List { .. } => panic!("not a picture"),
        };
        let pixels = self.pixels(grid.directions() as usize);
        self.bake(decoder, &latents, &Bake::rows(&pixels, grid, 0..rows).logarithm());
        self.read(&pixels)
    }
}

/// A decoder with weights from a formula.
pub(crate) fn filler(n: usize, hidden: usize, layers: usize) -> Model {
    let decoder = DecoderConfig { hidden, layers, heads: 1, ..DecoderConfig::default() };
    Model::filler(&ModelConfig { decoder, ..ModelConfig::decode_only(n) }, 5).unwrap()
}

pub(crate) fn latent(n: usize, seed: u64) -> Latent {
    Latent::from_seed(&Prior::standard(n), seed)
}

/// Directions spread over the sphere, poles included.
pub(crate) fn directions(count: usize) -> Vec<[f32; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - 2.0 * i as f64 / (count - 1).max(1) as f64;
            let (r, (sin, cos)) = ((1.0 - z * z).max(0.0).sqrt(), (golden * i as f64).sin_cos());
            [(r * cos) as f32, (r * sin) as f32, z as f32]
        })
        .collect()
}

/// Largest and mean difference. A NaN counts as infinite.
pub(crate) fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> (f32, f32) {
    assert_eq!(a.len(), b.len());
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    let all: Vec<_> = pairs.map(|(a, b)| if a == b { 0.0 } else { (a - b).abs() }).collect();
    let all = all.into_iter().map(|d| if d.is_nan() { f32::INFINITY } else { d });
    let (worst, sum) = all.fold((0.0f32, 0.0), |(worst, sum), d| (worst.max(d), sum + d));
    (worst, sum / (3 * a.len()) as f32)
}

/// The bounds that every adapter must keep: 1e-3 at most and 1e-4 on average, in log radiance.
pub(crate) fn agrees((worst, mean): (f32, f32)) -> bool {
    worst <= 1e-3 && mean <= 1e-4
}
