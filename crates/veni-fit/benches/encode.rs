//! One panorama of 128 × 64 to its latent: the shipped models' size and the paper's, on one thread and on all.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

#[allow(dead_code, reason = "each user needs a part of it")]
#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use veni_fit::Encoder;
use veni_light::model::EncoderConfig;
use veni_light::sphere::Equirect;

fn encode(criterion: &mut Criterion) {
    let small = EncoderConfig {
        samples: Some(128),
        channels: 96,
        depth: 4,
        heads: 6,
        head_channels: 16,
        ..EncoderConfig::default()
    };
    let grid = Equirect::new(128, 64);
    let image: Vec<f32> = (0..3 * grid.len()).map(|i| (1.7 * i as f32).sin()).collect();
    let images: Vec<&[f32]> = vec![&image; 8];
    let mut group = criterion.benchmark_group("encode");
    group.sample_size(30);
    for (name, config) in [("small", small), ("paper", EncoderConfig::default())] {
        for n in [9, 100] {
            let encoder = Encoder::new(&common::model(config.clone(), n)).expect("a whole model");
            let run = |images: &[&[f32]]| encoder.encode(grid, black_box(images)).expect("panoramas");
            group.bench_function(format!("{name}, N = {n}, 1 panorama"), |b| b.iter(|| run(&images[..1])));
            if n == 100 {
                continue;
            }
            group.bench_function(format!("{name}, N = {n}, 8 panoramas"), |b| b.iter(|| run(&images)));
            #[cfg(feature = "parallel")]
            group.bench_function(format!("{name}, N = {n}, 1 panorama, 1 thread"), |b| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
                b.iter(|| pool.install(|| run(&images[..1])));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, encode);
criterion_main!(benches);
