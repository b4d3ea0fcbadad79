//! The CPU decoder with filler weights: `cargo bench -p veni-light --features gradients --bench field`.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use veni_light::field::LocalQuadratic;
use veni_light::latent::{Latent, Prior};
use veni_light::model::{Model, ModelConfig};
use veni_light::sphere::Equirect;

#[allow(clippy::unwrap_used, reason = "a bench has no caller to report to")]
fn field(c: &mut Criterion) {
    for n in [9, 100] {
        let mut group = c.benchmark_group(format!("D={}", 3 * n));
        let model = Model::filler(&ModelConfig::decode_only(n), 1).unwrap();
        let decoder = model.decoder().unwrap();
        let latent = Latent::from_seed(&Prior::standard(n), 1);
        let field = decoder.condition(&latent).unwrap();
        group.bench_function("pack", |b| b.iter(|| black_box(&model).decoder().unwrap()));
        group.bench_function("condition", |b| b.iter(|| decoder.condition(black_box(&latent)).unwrap()));
        group.bench_function("radiance", |b| b.iter(|| field.radiance(black_box([0.6, 0.0, 0.8]))));
        group.sample_size(10);
        for (width, height) in [(128, 64), (1024, 512)] {
            let grid = Equirect::new(width, height);
            group.throughput(Throughput::Elements(grid.len() as u64));
            let name = format!("bake {width}x{height}");
            group.bench_function(name, |b| b.iter_with_large_drop(|| black_box(&field).bake(grid)));
        }
        // what a step of a fit costs; to be compared with twice the bake
        let directions = Equirect::new(128, 64).directions();
        group.throughput(Throughput::Elements(directions.len() as u64));
        let square = |_, p: [f32; 3]| (0.0, p);
        group.bench_function("gradient 128x64", |b| {
            b.iter_with_large_drop(|| black_box(&field).gradient(&directions, square));
        });
        let quadratic = |_, p: [f32; 3]| LocalQuadratic { loss: 0.0, gradient: p, weight: [1.0; 3] };
        group.bench_function("normal equations 128x64", |b| {
            b.iter_with_large_drop(|| black_box(&field).normal_equations(&directions, quadratic));
        });
        group.finish();
    }
}

criterion_group!(benches, field);
criterion_main!(benches);
