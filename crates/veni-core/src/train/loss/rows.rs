//! How much a pixel counts: a weight per image row.

use burn::tensor::{Device, Tensor, TensorData};
use std::f64::consts::PI;

/// sin θ at pixel centres, scaled to mean 1: [1, H, 1, 1]. The mean over all pixels of weight × value is
/// then the average over the sphere, for a pixel's exact solid angle is proportional to it.
pub fn solid_angle(height: usize, device: &Device) -> Tensor<4> {
    let sines: Vec<f64> = (0..height).map(|j| (PI * (j as f64 + 0.5) / height as f64).sin()).collect();
    let mean = sines.iter().sum::<f64>() / height as f64;
    rows(sines.into_iter().map(|s| s / mean), device)
}

/// The reference implementation's mask: min(sin(π r/(H−1)) + 0.001, 1), whose ends are the poles themselves: [1, H, 1, 1].
pub fn reference(height: usize, device: &Device) -> Tensor<4> {
    let last = (height.max(2) - 1) as f64;
    rows((0..height).map(|r| ((PI * r as f64 / last).sin() + 0.001).min(1.0)), device)
}

fn rows(values: impl Iterator<Item = f64>, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = values.map(|v| v as f32).collect();
    let height = values.len();
    Tensor::from_data(TensorData::new(values, [1, height, 1, 1]), device)
}
