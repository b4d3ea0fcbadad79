//! Names and shapes of the decoder's tensors.

use super::ModelConfig;

/// Names and shapes of all tensors of a decoder, in the order of evaluation.
///
/// With h = `decoder.hidden` and N = `latent_vectors`; linear weights are stored `[in, out]`, y = x W + b.
/// The one-key attention needs no query and no key.
///
/// | name (after `decoder.`) | shape | meaning |
/// |---|---|---|
/// | `condition.scale` | `[1]` | w: the latent's xy part is scaled by it before the VN-invariant layer |
/// | `condition.linear` | `[1, 2]` | a₀, the VN-linear of that layer |
/// | `condition.w`, `condition.u` | `[2, 2]` | W and U of its VN-ReLU |
/// | `input.weight`, `input.bias` | `[5(N+2), h], [h]` | the residual projection of the encoded direction |
/// | `layers.{l}.value.*` | `[3N, h], [h]` | the attention's value |
/// | `layers.{l}.out.*` | `[h, h], [h]` | the attention's output |
/// | `layers.{l}.norm1.gamma`, `.beta` | `[h]` | layer norm after the attention |
/// | `layers.{l}.ff1.*`, `.ff2.*` | `[h, h], [h]` | feed-forward, ReLU between |
/// | `layers.{l}.norm2.gamma`, `.beta` | `[h]` | layer norm after the feed-forward |
/// | `output.weight`, `output.bias` | `[h, 3], [3]` | log radiance |
pub fn decoder_schema(config: &ModelConfig) -> Vec<(String, Vec<usize>)> {
    let (n, h) = (config.latent_vectors, config.decoder.hidden);
    let mut all: Vec<(String, Vec<usize>)> = Vec::new();
    let mut put = |name: String, shape: &[usize]| all.push((format!("decoder.{name}"), shape.to_vec()));
    put("condition.scale".into(), &[1]);
    put("condition.linear".into(), &[1, 2]);
    put("condition.w".into(), &[2, 2]);
    put("condition.u".into(), &[2, 2]);
    put("input.weight".into(), &[5 * (n + 2), h]);
    put("input.bias".into(), &[h]);
    for l in 0..config.decoder.layers {
        for (linear, inputs) in [("value", 3 * n), ("out", h), ("ff1", h), ("ff2", h)] {
            put(format!("layers.{l}.{linear}.weight"), &[inputs, h]);
            put(format!("layers.{l}.{linear}.bias"), &[h]);
        }
        for norm in ["norm1", "norm2"] {
            put(format!("layers.{l}.{norm}.gamma"), &[h]);
            put(format!("layers.{l}.{norm}.beta"), &[h]);
        }
    }
    put("output.weight".into(), &[h, 3]);
    put("output.bias".into(), &[3]);
    all
}
