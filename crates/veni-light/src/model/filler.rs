//! Weights from a formula: for benches, tests and documentation that need a decoder but no asset.

use super::{Array, Conditioning, Model, ModelConfig, ModelInfo, decoder_schema};
use crate::Result;

impl Model {
    /// A decode-only model with pseudo-random weights of trained-like magnitude, the same on every machine.
    ///
    /// Each tensor is filled by SplitMix64 started at FNV-1a(key) ⊕ seed, where the key is the name the
    /// tensor has in the reference implementation; their layout [out, in] is transposed to ours. The golden cases
    /// named `*_filler` use the same formula, so this builds their decoders.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if the configuration is; an encoder in it is dropped.
    pub fn filler(config: &ModelConfig, seed: u64) -> Result<Self> {
        config.validate()?;
        let config = ModelConfig { encoder: None, ..config.clone() };
        let tensors = decoder_schema(&config).into_iter().map(|(name, shape)| {
            let data = fill(&official_key(&name, &config), &shape, seed);
            (name, Array { shape, data })
        });
        let tensors = tensors.collect();
        Self::new(config, tensors, ModelInfo::default())
    }
}

/// The reference implementation's name of a decoder tensor. They have no tokens; those have the names of the attention.
fn official_key(name: &str, config: &ModelConfig) -> String {
    let name = name.strip_prefix("decoder.").unwrap_or(name);
    match name {
        "condition.scale" => return "vn_proj_in.1.weight".into(),
        "condition.linear" => return "vn_invar.mlp.0.weight".into(),
        "condition.w" => return "vn_invar.mlp.1.W".into(),
        "condition.u" => return "vn_invar.mlp.1.U".into(),
        _ => {}
    }
    let layers = config.decoder.layers;
    let renamed = match config.decoder.conditioning {
        Conditioning::Concat => sine_key(name, "linear", &format!("net.{}", layers + 1)),
        Conditioning::Film => sine_key(name, "layer", "final_layer"),
        Conditioning::Attention | Conditioning::Tokens => {
            let pairs = [
                ("input.", "residual_projection."),
                ("output.", "fc."),
                (".query.", ".mha.query."),
                (".key.", ".mha.key."),
                (".value.", ".mha.value."),
                (".out.", ".mha.fc_out."),
                (".ff1.", ".fc.0."),
                (".ff2.", ".fc.2."),
                (".gamma", ".weight"),
                (".beta", ".bias"),
            ];
            pairs.iter().fold(name.to_owned(), |name, (ours, theirs)| name.replace(ours, theirs))
        }
    };
    format!("network.{renamed}")
}

/// The same in a network of sines, whose input map is layer 0 and whose maps are called `map`.
fn sine_key(name: &str, map: &str, output: &str) -> String {
    let parts: Vec<_> = name.split('.').collect();
    match parts[..] {
        ["input", part] => format!("net.0.{map}.{part}"),
        ["output", part] => format!("{output}.{part}"),
        ["layers", l, part] => format!("net.{}.{map}.{part}", l.parse::<usize>().map_or(0, |l| l + 1)),
        ["mapping", k, part] => {
            // a ReLU between two maps has a number of its own
            format!("mapping_network.network.{}.{part}", k.parse::<usize>().map_or(0, |k| 2 * k))
        }
        _ => name.to_owned(),
    }
}

/// `shape` is ours: [in, out] for matrices, which the formula sees as [out, in].
fn fill(key: &str, shape: &[usize], seed: u64) -> Vec<f32> {
    let inputs = if shape.len() == 2 { shape[0] } else { 1 };
    let (centre, amplitude) = if key.ends_with("norm1.weight") || key.ends_with("norm2.weight") {
        (1.0, 0.2)
    } else if key.ends_with(".bias") {
        (0.0, 0.1)
    } else if key == "vn_proj_in.1.weight" {
        (0.8, 0.0)
    } else {
        (0.0, 3f64.sqrt() / (inputs as f64).sqrt())
    };
    let mut state = key.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    state ^= seed;
    let count = shape.iter().product();
    let row_major: Vec<f32> = (0..count)
        .map(|_| {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            (centre + amplitude * unit(state)) as f32
        })
        .collect();
    match shape {
        [inputs, outputs] => (0..count).map(|i| row_major[(i % outputs) * inputs + i / outputs]).collect(),
        _ => row_major,
    }
}

/// SplitMix64's finaliser, mapped to [−1, 1).
fn unit(state: u64) -> f64 {
    let mut z = state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    2.0 * ((z >> 11) as f64 * (-53f64).exp2()) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers are those of the golden files' description: key "abc", seed 5.
    #[test]
    fn formula_matches_its_published_check() {
        let values = fill("abc", &[3], 5);
        let expected = [0.284_056_507_657_906_9, -0.871_570_389_645_170_5, 0.788_673_614_101_210_7];
        for (value, expected) in values.iter().zip(expected) {
            assert_eq!(*value, (3f64.sqrt() * expected) as f32);
        }
    }

    #[test]
    fn keys_are_those_of_the_reference() {
        let mut config = ModelConfig::decode_only(5);
        let key = |name: &str, config: &ModelConfig| official_key(&format!("decoder.{name}"), config);
        assert_eq!(key("input.weight", &config), "network.residual_projection.weight");
        assert_eq!(key("layers.5.out.bias", &config), "network.layers.5.mha.fc_out.bias");
        assert_eq!(key("layers.0.norm1.gamma", &config), "network.layers.0.norm1.weight");
        assert_eq!(key("layers.3.ff2.weight", &config), "network.layers.3.fc.2.weight");
        assert_eq!(key("output.bias", &config), "network.fc.bias");
        config.decoder.layers = 2;
        config.decoder.conditioning = Conditioning::Concat;
        assert_eq!(key("input.weight", &config), "network.net.0.linear.weight");
        assert_eq!(key("layers.1.bias", &config), "network.net.2.linear.bias");
        assert_eq!(key("output.bias", &config), "network.net.3.bias");
        config.decoder.conditioning = Conditioning::Film;
        assert_eq!(key("layers.0.bias", &config), "network.net.1.layer.bias");
        assert_eq!(key("mapping.2.weight", &config), "network.mapping_network.network.4.weight");
        assert_eq!(key("output.weight", &config), "network.final_layer.weight");
    }
}
