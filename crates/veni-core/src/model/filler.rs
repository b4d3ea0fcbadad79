//! Weights from a formula: for benches, tests and documentation that need a decoder but no asset.

use super::{Model, ModelConfig, ModelInfo, Tensor, decoder_schema};
use crate::Result;

impl Model {
    /// A decode-only model with pseudo-random weights of trained-like magnitude, the same on every machine.
    ///
    /// Each tensor is filled by SplitMix64 started at FNV-1a(key) ⊕ seed, where the key is the name the
    /// tensor has in the authors' program; their layout [out, in] is transposed to ours. The golden cases
    /// named `*_filler` use the same formula, so this builds their decoders.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if the configuration is; an encoder in it is dropped.
    pub fn filler(config: &ModelConfig, seed: u64) -> Result<Self> {
        config.validate()?;
        let config = ModelConfig { encoder: None, ..config.clone() };
        let tensors = decoder_schema(&config).into_iter().map(|(name, shape)| {
            let data = fill(&official_key(&name), &shape, seed);
            (name, Tensor { shape, data })
        });
        let tensors = tensors.collect();
        Self::new(config, tensors, ModelInfo::default())
    }
}

/// The authors' name of a decoder tensor.
fn official_key(name: &str) -> String {
    let name = name.strip_prefix("decoder.").unwrap_or(name);
    match name {
        "condition.scale" => return "vn_proj_in.1.weight".into(),
        "condition.linear" => return "vn_invar.mlp.0.weight".into(),
        "condition.w" => return "vn_invar.mlp.1.W".into(),
        "condition.u" => return "vn_invar.mlp.1.U".into(),
        _ => {}
    }
    let pairs = [
        ("input.", "residual_projection."),
        ("output.", "fc."),
        (".value.", ".mha.value."),
        (".out.", ".mha.fc_out."),
        (".ff1.", ".fc.0."),
        (".ff2.", ".fc.2."),
        (".gamma", ".weight"),
        (".beta", ".bias"),
    ];
    let renamed = pairs.iter().fold(name.to_owned(), |name, (ours, theirs)| name.replace(ours, theirs));
    format!("network.{renamed}")
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
    fn keys_are_the_authors() {
        let key = |name: &str| official_key(&format!("decoder.{name}"));
        assert_eq!(key("input.weight"), "network.residual_projection.weight");
        assert_eq!(key("layers.5.out.bias"), "network.layers.5.mha.fc_out.bias");
        assert_eq!(key("layers.0.norm1.gamma"), "network.layers.0.norm1.weight");
        assert_eq!(key("layers.3.ff2.weight"), "network.layers.3.fc.2.weight");
        assert_eq!(key("output.bias"), "network.fc.bias");
    }
}
