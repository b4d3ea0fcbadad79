//! The field against the golden files, against a plain f64 implementation, and against its symmetries.

mod golden;
#[cfg(feature = "gradients")]
mod gradient;
mod lights;
#[cfg(feature = "gradients")]
mod moments;
#[cfg(feature = "gradients")]
mod normal;
mod properties;
mod reference;

use crate::model::{DecoderConfig, Model, ModelConfig, VnReluForm};

/// A model of the paper's decoder size with filler weights.
fn filler(latent_vectors: usize) -> Model {
    Model::filler(&ModelConfig::decode_only(latent_vectors), 7).unwrap()
}

/// A small one with sizes that fill no register evenly.
fn odd(latent_vectors: usize, hidden: usize, vn_relu: VnReluForm) -> Model {
    let decoder = DecoderConfig { hidden, layers: 3, heads: 1, vn_relu, ..DecoderConfig::default() };
    Model::filler(&ModelConfig { decoder, ..ModelConfig::decode_only(latent_vectors) }, 11).unwrap()
}

/// Directions spread over the sphere, poles included.
fn directions(count: usize) -> Vec<[f32; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let spiral = |i: usize| {
        let z = 1.0 - 2.0 * i as f64 / (count - 1) as f64;
        let (radius, (sin, cos)) = ((1.0 - z * z).max(0.0).sqrt(), (golden * i as f64).sin_cos());
        [(radius * cos) as f32, (radius * sin) as f32, z as f32]
    };
    (0..count).map(spiral).collect()
}

/// Largest absolute difference.
fn distance(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    assert_eq!(a.len(), b.len());
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    // a NaN counts as infinitely far
    pairs
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |worst, d| if d.is_nan() { f32::INFINITY } else { d.max(worst) })
}
