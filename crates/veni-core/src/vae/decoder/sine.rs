//! Networks of sines: SIREN (concat conditioning) and its modulated form (FiLM). MODEL (21, 22).

use super::Linear;
use crate::nn::{normal, uniform};
use burn::tensor::{Device, Tensor, activation::leaky_relu};
use veni_light::model::DecoderConfig;
use veni_light::model::mapping_sizes;
use veni_light::random::Stream;

/// Slope of the mapping network's leaky ReLU below 0.
const SLOPE: f64 = 0.2;
/// Frequencies are 15 f + 30 for an output f of the mapping network (Chan et al. 2021).
const FREQUENCY: [f64; 2] = [15.0, 30.0];
/// The frequency that FiLM's weights are initialised for.
const INITIAL_FREQUENCY: f64 = 25.0;

/// A map inside a sine, initialised such that the activations keep their distribution from layer to layer
/// (Sitzmann et al. 2020): weights uniform in ±√(6/inputs)/ω, the bias in ±1/√inputs.
pub(super) fn hidden_map(
    omega: f64,
    inputs: usize,
    outputs: usize,
    rng: &mut Stream,
    device: &Device,
) -> Linear {
    map((6.0 / inputs as f64).sqrt() / omega, inputs, outputs, rng, device)
}

/// The map inside the first sine: weights uniform in ±1/inputs, the bias in ±1/√inputs.
pub(super) fn first_map(inputs: usize, outputs: usize, rng: &mut Stream, device: &Device) -> Linear {
    map(1.0 / inputs as f64, inputs, outputs, rng, device)
}

fn map(bound: f64, inputs: usize, outputs: usize, rng: &mut Stream, device: &Device) -> Linear {
    Linear {
        weight: uniform([inputs, outputs], bound, rng, device),
        bias: uniform([outputs], 1.0 / (inputs as f64).sqrt(), rng, device),
    }
}

/// ω of a network's maps at the start: FiLM's own, or the configured one.
pub(super) fn initial_omega(config: &DecoderConfig) -> f64 {
    if config.conditioning == veni_light::model::Conditioning::Film {
        INITIAL_FREQUENCY
    } else {
        config.omega
    }
}

/// FiLM's mapping network: weights normal with deviation √(2/(1 + 0.2²)/inputs) (He et al. 2015), those of the last
/// map a quarter of that, biases uniform in ±1/√inputs.
pub(super) fn mapping(
    config: &DecoderConfig,
    latent_vectors: usize,
    rng: &mut Stream,
    device: &Device,
) -> Vec<Linear> {
    let sizes = mapping_sizes(config, latent_vectors);
    let last = sizes.len() - 2;
    let linear = |(k, size): (usize, &[usize])| {
        let (inputs, outputs) = (size[0], size[1]);
        let deviation = (2.0 / (1.0 + SLOPE * SLOPE) / inputs as f64).sqrt();
        let deviation = if k == last { 0.25 * deviation } else { deviation };
        Linear {
            weight: normal([inputs, outputs], [0.0, deviation], rng, device),
            bias: uniform([outputs], 1.0 / (inputs as f64).sqrt(), rng, device),
        }
    };
    sizes.windows(2).enumerate().map(linear).collect()
}

/// sin(ω x), then sin(ω(Wx + b)) of every layer: the first map's output x [B, R, h] → [B, R, h].
pub(super) fn siren(omega: f64, layers: &[Linear], x: Tensor<3>) -> Tensor<3> {
    layers.iter().fold((x * omega).sin(), |x, layer| (layer.forward(x) * omega).sin())
}

/// sin(ω_l ∘ x + φ_l) in place of it, frequencies and phases from the latent's condition features [B, C]:
/// the mapping network's output is [f of every sine | φ of every sine], and ω = 15 f + 30.
pub(super) fn film(mapping: &[Linear], features: Tensor<2>, layers: &[Linear], x: Tensor<3>) -> Tensor<3> {
    let mut modulation = features;
    for (k, linear) in mapping.iter().enumerate() {
        let input = if k == 0 { modulation } else { leaky_relu(modulation, SLOPE) };
        modulation = linear.forward(input);
    }
    let hidden = x.dims()[2];
    let half = modulation.dims()[1] / 2;
    let part = |from: usize| modulation.clone().narrow(1, from, hidden).unsqueeze_dim::<3>(1);
    let sine = |x: Tensor<3>, l: usize| {
        let frequency = part(l * hidden) * FREQUENCY[0] + FREQUENCY[1];
        (x * frequency + part(half + l * hidden)).sin()
    };
    layers.iter().enumerate().fold(sine(x, 0), |x, (l, layer)| sine(layer.forward(x), l + 1))
}
