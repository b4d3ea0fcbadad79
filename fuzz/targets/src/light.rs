//! Models and latents.

use std::collections::BTreeMap;
use std::path::Path;

use veni_fit::encoder::Encoder;
use veni_light::latent::Latent;
use veni_light::model::{Array, Model, ModelConfig, ModelInfo, StoredType, decoder_schema};
use veni_light::sphere::Equirect;

use super::{Target, untouched};

pub(super) const TARGETS: &[Target] = &[
    Target { name: "model", run: model, seeds: models, repair: untouched },
    Target { name: "latent", run: latent, seeds: latents, repair: untouched },
];

/// Loads, folds a field of it and encodes a panorama, as bake and encode do.
fn model(path: &Path) -> bool {
    let Ok(model) = Model::load(path) else { return false };
    let latent = Latent::new(vec![[0.5, -0.25, 1.0]; model.latent_vectors()]);
    if let Ok(field) = model.decoder().and_then(|decoder| decoder.condition(&latent)) {
        let _ = field.evaluator().radiance([0.0, 0.6, 0.8]);
    }
    if let Ok(encoder) = Encoder::new(&model) {
        let grid = Equirect::new(8, 4);
        let _ = encoder.encode(grid, &[&vec![0.0; 3 * grid.len()]]);
    }
    true
}

fn latent(path: &Path) -> bool {
    let Ok(latent) = Latent::load(path) else { return false };
    let text = latent.to_json().expect("what was read can be written");
    assert_eq!(Latent::from_json(&text).expect("and read again"), latent);
    true
}

fn models() -> Vec<Vec<u8>> {
    let mut config = ModelConfig::decode_only(2);
    (config.decoder.hidden, config.decoder.layers, config.decoder.heads) = (4, 1, 1);
    let tensors: BTreeMap<String, Array> = decoder_schema(&config)
        .into_iter()
        .map(|(name, shape)| {
            let count = shape.iter().product();
            (name, Array { data: (0..count).map(|k| 0.25 - 0.125 * (k % 5) as f32).collect(), shape })
        })
        .collect();
    let model = Model::new(config, tensors, ModelInfo::default()).expect("a model");
    [StoredType::F16, StoredType::F32].map(|stored| model.to_bytes(stored).expect("its bytes")).to_vec()
}

fn latents() -> Vec<Vec<u8>> {
    let full = br#"{"format":1,"model":"0123456789abcdef","n":2,"vectors":[[0.1,0.2,0.3],[0.4,0.5,0.6]],"exposure":-0.5,"source":"street.hdr"}"#;
    vec![full.to_vec(), br#"{"format":1,"n":1,"vectors":[[1,2,3]],"exposure":0}"#.to_vec()]
}
