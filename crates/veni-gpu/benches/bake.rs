//! Baking on every adapter and on the CPU, filler weights: `cargo bench -p veni-gpu --bench bake`.
//!
//! The CPU's largest takes minutes (`-- 128` keeps the smallest only); software adapters get the smallest alone.
//! `veni-cli bench` prints all of them as a table, with each device's own rate of multiply-adds beside it.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use veni_gpu::adapters::{self, Opened};
use veni_gpu::wgpu::{
    CommandEncoderDescriptor, Extent3d, PollType, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages,
};
use veni_gpu::{Bake, GpuDecoder};
use veni_light::latent::{Latent, Prior};
use veni_light::model::{Model, ModelConfig};
use veni_light::sphere::Equirect;

const SIZES: [[u32; 2]; 4] = [[128, 64], [1024, 512], [2048, 1024], [4096, 2048]];

fn bake(c: &mut Criterion) {
    let found = pollster::block_on(adapters::list());
    for n in [9, 100] {
        let model = Model::filler(&ModelConfig::decode_only(n), 1).expect("a valid configuration");
        let latent = Latent::from_seed(&Prior::standard(n), 1);
        on_cpu(c, &model, &latent, n);
        for adapter in &found {
            let opened = pollster::block_on(adapter.open()).expect("an adapter that opens");
            let sizes = if adapter.is_software() { &SIZES[..1] } else { &SIZES };
            on_gpu(c, &opened, &model, &latent, n, sizes);
        }
    }
}

fn on_cpu(c: &mut Criterion, model: &Model, latent: &Latent, n: usize) {
    let field =
        model.decoder().expect("a decoder that folds").condition(latent).expect("a latent of this model");
    let mut group = c.benchmark_group(format!("N = {n} on the CPU"));
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    for [width, height] in &SIZES {
        let grid = Equirect::new(*width as usize, *height as usize);
        group.throughput(Throughput::Elements(grid.len() as u64));
        group.bench_function(format!("{width} × {height}"), |b| b.iter(|| black_box(field.bake(grid))));
    }
    group.finish();
}

fn on_gpu(c: &mut Criterion, opened: &Opened, model: &Model, latent: &Latent, n: usize, sizes: &[[u32; 2]]) {
    let (device, queue) = (&opened.device, &opened.queue);
    let decoder = GpuDecoder::new(device, model).expect("memory for the weights");
    let latents = decoder.condition(queue, latent).expect("a latent of this model");
    let mut group = c.benchmark_group(format!("N = {n} on {opened}"));
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    for [width, height] in sizes {
        let texture = device.create_texture(&TextureDescriptor {
            label: None,
            size: Extent3d { width: *width, height: *height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: TextureFormat::Rgba16Float,
            usage: TextureUsages::STORAGE_BINDING,
            view_formats: &[],
        });
        group.throughput(Throughput::Elements(u64::from(*width) * u64::from(*height)));
        group.bench_function(format!("{width} × {height}"), |b| {
            b.iter(|| {
                let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
                decoder.bake(&mut encoder, &latents, &Bake::equirect(&texture)).expect("a texture that fits");
                queue.submit([encoder.finish()]);
                device.poll(PollType::wait_indefinitely()).expect("a device that is there");
            });
        });
    }
    group.finish();
}

criterion_group!(benches, bake);
criterion_main!(benches);
