//! Names and shapes of the decoder's tensors.

use super::{Conditioning, DecoderConfig, ModelConfig};

/// Names and shapes of all tensors of a decoder, in the order of evaluation.
///
/// With h = `decoder.hidden`, N = `latent_vectors`, D and C the widths of the directional and the conditioning input
/// ([`DecoderConfig::direction_inputs`], [`condition_inputs`](DecoderConfig::condition_inputs); 5(N + 2) and 3N for
/// the paper's network); linear weights are stored `[in, out]`, y = x W + b. c is 2 under SO(2), 3 under SO(3).
///
/// | name (after `decoder.`) | shape | meaning |
/// |---|---|---|
/// | `condition.scale` | `[1]` | w: the latent's xy part is scaled by it before the VN-invariant layer |
/// | `condition.linear` | `[1, c]` | a₀, the VN-linear of that layer |
/// | `condition.w`, `condition.u` | `[c, c]` | W and U of its VN-ReLU |
/// | `input.weight`, `input.bias` | `[D, h], [h]` | the map of the directional input; `[D + C, h]` for concat |
/// | `output.weight`, `output.bias` | `[h, 3], [3]` | the output map |
///
/// The first three exist with VN invariance under a rotation group only. Attention, where the one key needs no query:
///
/// | name | shape | meaning |
/// |---|---|---|
/// | `layers.{l}.value.*` | `[C, h], [h]` | the attention's value |
/// | `layers.{l}.out.*` | `[h, h], [h]` | the attention's output |
/// | `layers.{l}.norm1.gamma`, `.beta` | `[h]` | layer norm after the attention |
/// | `layers.{l}.ff1.*`, `.ff2.*` | `[h, h], [h]` | feed-forward, ReLU between |
/// | `layers.{l}.norm2.gamma`, `.beta` | `[h]` | layer norm after the feed-forward |
///
/// Tokens: the same, with value `[h, h]` and beside it
///
/// | name | shape | meaning |
/// |---|---|---|
/// | `tokens.weight`, `tokens.bias` | `[C/N, h], [N, h]` | each vector's token, with a bias of its own |
/// | `layers.{l}.query.*`, `.key.*` | `[h, h], [h]` | the attention's query and key |
///
/// Concat and FiLM:
///
/// | name | shape | meaning |
/// |---|---|---|
/// | `layers.{l}.weight`, `.bias` | `[h, h], [h]` | the map inside a sine |
/// | `mapping.{k}.weight`, `.bias` | | FiLM: C to `mapping_features`, … to 2h(`layers` + 1) |
pub fn decoder_schema(config: &ModelConfig) -> Vec<(String, Vec<usize>)> {
    let (n, decoder) = (config.latent_vectors, &config.decoder);
    let (h, condition) = (decoder.hidden, decoder.condition_inputs(n));
    let mut all = Names(Vec::new());
    if let Some(c) = decoder.vn_channels() {
        all.put("condition.scale", &[1]);
        all.put("condition.linear", &[1, c]);
        all.put("condition.w", &[c, c]);
        all.put("condition.u", &[c, c]);
    }
    match decoder.conditioning {
        Conditioning::Tokens => {
            all.put("tokens.weight", &[condition / n, h]);
            all.put("tokens.bias", &[n, h]);
        }
        Conditioning::Film => {
            let sizes = mapping_sizes(decoder, n);
            sizes.windows(2).enumerate().for_each(|(k, s)| all.linear(&format!("mapping.{k}"), s[0], s[1]));
        }
        Conditioning::Attention | Conditioning::Concat => {}
    }
    let beside = if decoder.conditioning == Conditioning::Concat { condition } else { 0 };
    all.linear("input", decoder.direction_inputs(n) + beside, h);
    for l in 0..decoder.layers {
        let layer = format!("layers.{l}");
        match decoder.conditioning {
            Conditioning::Attention => all.residual(&layer, &[("value", condition)], h),
            Conditioning::Tokens => all.residual(&layer, &[("query", h), ("key", h), ("value", h)], h),
            Conditioning::Film | Conditioning::Concat => all.linear(&layer, h, h),
        }
    }
    all.linear("output", h, 3);
    all.0
}

/// Features of FiLM's mapping network from its input to its output.
pub fn mapping_sizes(decoder: &DecoderConfig, latent_vectors: usize) -> Vec<usize> {
    let mut sizes = vec![decoder.condition_inputs(latent_vectors)];
    sizes.resize(1 + decoder.mapping_layers, decoder.mapping_features);
    sizes.push(2 * decoder.hidden * (decoder.layers + 1));
    sizes
}

struct Names(Vec<(String, Vec<usize>)>);

impl Names {
    fn put(&mut self, name: &str, shape: &[usize]) {
        self.0.push((format!("decoder.{name}"), shape.to_vec()));
    }

    fn linear(&mut self, name: &str, inputs: usize, outputs: usize) {
        self.put(&format!("{name}.weight"), &[inputs, outputs]);
        self.put(&format!("{name}.bias"), &[outputs]);
    }

    /// A residual layer whose attention starts with these maps to h features.
    fn residual(&mut self, layer: &str, attention: &[(&str, usize)], h: usize) {
        for (name, inputs) in attention.iter().chain(&[("out", h), ("ff1", h), ("ff2", h)]) {
            self.linear(&format!("{layer}.{name}"), *inputs, h);
        }
        for norm in ["norm1", "norm2"] {
            self.put(&format!("{layer}.{norm}.gamma"), &[h]);
            self.put(&format!("{layer}.{norm}.beta"), &[h]);
        }
    }
}
