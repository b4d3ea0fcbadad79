//! The learning world: what encoding a panorama and learning from it cost.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use burn::tensor::{Device, Tensor, TensorData};
use criterion::{Criterion, criterion_group, criterion_main};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use veni_core::model::EncoderConfig;
use veni_core::vae::Encoder;

/// The paper's encoder, and one of 1.9 M parameters.
fn sizes() -> [(&'static str, EncoderConfig); 2] {
    let small = EncoderConfig {
        samples: Some(128),
        channels: 96,
        depth: 4,
        heads: 6,
        head_channels: 16,
        ..EncoderConfig::default()
    };
    [("paper", EncoderConfig::default()), ("small", small)]
}

/// Directions and log radiance of one panorama; what they are does not change the time.
fn panorama(config: &EncoderConfig, device: &Device) -> (Tensor<3>, Tensor<4>) {
    let shape = [1, config.stripes, config.samples.expect("stripes"), 3];
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut draw = || {
        let values =
            (0..shape.iter().product::<usize>()).map(|_| rng.next_u32() as f32 / u32::MAX as f32 - 0.5);
        Tensor::<4>::from_data(TensorData::new(values.collect::<Vec<_>>(), shape), device)
    };
    (draw().squeeze_dim(0), draw())
}

/// One panorama to the mean and log variance of its latent (N = 9).
fn encoder_forward(criterion: &mut Criterion) {
    let device = Device::flex();
    let mut group = criterion.benchmark_group("encode");
    group.sample_size(20);
    for (name, config) in sizes() {
        let encoder =
            Encoder::new(&config, 9, &mut ChaCha8Rng::seed_from_u64(1), &device).expect("a valid size");
        let (directions, radiance) = panorama(&config, &device);
        let folded = encoder.clone().fold();
        group.bench_function(format!("{name}, folded"), |b| {
            b.iter(|| {
                let posterior = folded.forward(black_box(directions.clone()), radiance.clone());
                (posterior.mean.into_data(), posterior.log_variance.map(Tensor::into_data))
            });
        });
        group.bench_function(format!("{name}, as in training"), |b| {
            b.iter(|| encoder.forward(black_box(directions.clone()), radiance.clone()).mean.into_data());
        });
    }
    group.finish();
}

/// Forward and backward of the encoder for a batch of four, with gradients of all weights.
fn encoder_gradient(criterion: &mut Criterion) {
    let device = Device::flex().autodiff();
    let mut group = criterion.benchmark_group("encoder gradient, 4 images");
    group.sample_size(10);
    for (name, config) in sizes() {
        let encoder =
            Encoder::new(&config, 9, &mut ChaCha8Rng::seed_from_u64(1), &device).expect("a valid size");
        let (directions, radiance) = panorama(&config, &device);
        let radiance = radiance.repeat_dim(0, 4);
        group.bench_function(name, |b| {
            b.iter(|| {
                let posterior = encoder.forward(directions.clone(), radiance.clone());
                let loss = posterior.kld().expect("variational").sum();
                loss.backward()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, encoder_forward, encoder_gradient);
criterion_main!(benches);
