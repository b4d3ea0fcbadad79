//! What renderers need of a map, as fast as it is: `cargo bench -p veni-light --features pretrained,prefilter --bench light`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use veni_light::latent::Latent;
use veni_light::light::{CompactLight, EnvironmentMap, Law, Levels, Light, Prefilter, Sampler, Sh, Spectrum};
use veni_light::model::Model;
use veni_light::random::Stream;
use veni_light::sphere::Equirect;

/// A sky with waves, a sun of its true size and a lamp.
fn sky(grid: Equirect) -> Vec<[f32; 3]> {
    let wave = |[x, y, z]: [f32; 3]| {
        let cloud = 1.0 + 0.3 * (9.0 * x + 4.0 * y).sin() * (7.0 * y - 5.0 * z).cos();
        if z > 0.0 {
            [0.3, 0.5, 0.9].map(|v| v * cloud * (1.5 - z))
        } else {
            [0.12, 0.1, 0.08].map(|v| v * cloud)
        }
    };
    let mut pixels: Vec<_> = grid.directions().into_iter().map(wave).collect();
    for (direction, irradiance, degrees) in
        [([0.64, -0.48, 0.6], [12.0, 11.0, 9.0], 0.2665f32), ([-0.8, 0.36, 0.48], [0.8, 0.6, 0.3], 1.0)]
    {
        let radius = degrees.to_radians();
        CompactLight::new(direction, irradiance, radius).add_to(grid, &mut pixels);
    }
    pixels
}

#[allow(clippy::unwrap_used, reason = "a bench has no caller to report to")]
fn light(c: &mut Criterion) {
    let mut group = c.benchmark_group("light");
    group.sample_size(10);
    for width in [1024, 2048, 4096] {
        let grid = Equirect::new(width, width / 2);
        let pixels = sky(grid);
        let map = EnvironmentMap::new(grid, &pixels).unwrap();
        let size = format!("{width}x{}", width / 2);
        group.bench_function(format!("lights of {size}"), |b| b.iter_with_large_drop(|| Light::of(map)));
        group.bench_function(format!("nine harmonics of {size}"), |b| b.iter(|| Sh::<2>::of(map)));
        group.bench_function(format!("sampler of {size}"), |b| b.iter_with_large_drop(|| Sampler::new(map)));
    }
    let model = Model::pretrained();
    let field = model.decoder().unwrap().condition(&Latent::from_seed(&model.prior(), 19)).unwrap();
    for width in [128, 256] {
        group.bench_function(format!("a latent to lights and harmonics, {width} wide"), |b| {
            b.iter(|| Light::of_field(&field, width).unwrap().sh());
        });
    }
    group.finish();
}

#[allow(clippy::unwrap_used, reason = "a bench has no caller to report to")]
fn maps(c: &mut Criterion) {
    let mut group = c.benchmark_group("prefiltered");
    group.sample_size(10);
    let grid = Equirect::new(2048, 1024);
    let pixels = sky(grid);
    let light = Light::of(EnvironmentMap::new(grid, &pixels).unwrap());
    let rest = light.residual();
    for size in [256, 512] {
        let levels = Levels::down_to(size, 16, Law::Quadratic);
        group.bench_function(format!("spectrum of 2048x1024 for {size}"), |b| {
            b.iter_with_large_drop(|| Prefilter::new(rest, &[levels]));
        });
        let prefilter = Prefilter::new(rest, &[levels]);
        group.bench_function(format!("levels of {size}"), |b| {
            b.iter_with_large_drop(|| prefilter.specular(levels, veni_light::light::CubeAxes::GLTF, |_| ()));
        });
    }
    group.bench_function("spectrum of 2048x1024 to degree 64", |b| b.iter(|| Spectrum::of(rest, 64)));
    group.finish();
}

#[allow(clippy::unwrap_used, reason = "a bench has no caller to report to")]
fn samples(c: &mut Criterion) {
    let mut group = c.benchmark_group("sampler of 2048x1024");
    let grid = Equirect::new(2048, 1024);
    let pixels = sky(grid);
    let sampler = Sampler::new(EnvironmentMap::new(grid, &pixels).unwrap());
    let mut stream = Stream::from_seed(1);
    let mut number = || (stream.next_u32() >> 8) as f32 / (1 << 24) as f32;
    let numbers: Vec<[f32; 2]> = (0..4096).map(|_| [number(), number()]).collect();
    let directions: Vec<_> = numbers.iter().map(|u| sampler.sample(*u).direction).collect();
    group.bench_function("4096 samples", |b| {
        // all of a sample is used, or the compiler leaves out what is not
        b.iter(|| {
            for u in &numbers {
                let _ = black_box(sampler.sample(black_box(*u)));
            }
        });
    });
    group.bench_function("4096 densities", |b| {
        b.iter(|| directions.iter().map(|d| sampler.pdf(black_box(*d))).sum::<f32>());
    });
    group.finish();
}

criterion_group!(benches, light, maps, samples);
criterion_main!(benches);
