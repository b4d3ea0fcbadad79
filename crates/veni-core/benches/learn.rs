//! What encoding a panorama, decoding it and learning from it cost.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use burn::tensor::{Device, Tensor, TensorData};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use veni_core::train::loss::{Loss, LossConfig};
use veni_core::vae::{Decoder, Encoder};
use veni_light::model::{DecoderConfig, EncoderConfig};
use veni_light::random::Stream;
use veni_light::sphere::Equirect;

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
    let mut rng = Stream::from_seed(2);
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
        let encoder = Encoder::new(&config, 9, &mut Stream::from_seed(1), &device).expect("a valid size");
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
        let encoder = Encoder::new(&config, 9, &mut Stream::from_seed(1), &device).expect("a valid size");
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

/// Forward and backward of the decoder for four images in 2048 directions each, with gradients of all
/// weights and of the latents; and of the losses of a training step.
fn decoder_gradient(criterion: &mut Criterion) {
    let device = Device::flex().autodiff();
    let mut group = criterion.benchmark_group("decoder gradient, 4 × 2048 directions");
    group.sample_size(10);
    let grid = Equirect::new(64, 32);
    let directions = TensorData::new(grid.directions().into_flattened(), [grid.len(), 3]);
    let directions = Tensor::<2>::from_data(directions, &device);
    for n in [9, 100] {
        let config = DecoderConfig::default();
        let decoder = Decoder::new(&config, n, &mut Stream::from_seed(1), &device);
        let values: Vec<f32> = (0..4 * n * 3).map(|i| (1.3 * i as f32).sin()).collect();
        let latent = Tensor::<3>::from_data(TensorData::new(values, [4, n, 3]), &device).require_grad();
        let (m, h) = (n + 2, config.hidden);
        // Multiply-adds per direction; the backward pass has two products for each of the forward one's.
        let multiply_adds = 3 * (4 * m * h + config.layers * 2 * h * h + 3 * h);
        group.throughput(Throughput::Elements((2 * multiply_adds * 4 * grid.len()) as u64));
        group.bench_function(format!("N = {n}, throughput in FLOP/s"), |b| {
            b.iter(|| decoder.forward(latent.clone(), directions.clone()).sum().backward());
        });
    }
    let loss = Loss::new(&LossConfig::default(), grid.height, grid.width, &device);
    let shape = [4, grid.height, grid.width, 3];
    let image = |phase: f32| {
        let values: Vec<f32> = (0..4 * grid.len() * 3).map(|i| (1.3 * i as f32 + phase).sin()).collect();
        Tensor::<4>::from_data(TensorData::new(values, shape), &device)
    };
    let (prediction, target) = (image(0.0).require_grad(), image(1.0));
    group.throughput(Throughput::Elements(1));
    group.bench_function("losses alone", |b| {
        b.iter(|| loss.terms(0, prediction.clone(), target.clone(), None).total().backward());
    });
    group.finish();
}

criterion_group!(benches, encoder_forward, encoder_gradient, decoder_gradient);
criterion_main!(benches);
