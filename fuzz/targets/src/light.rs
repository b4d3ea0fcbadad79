//! Models and latents.

use std::collections::BTreeMap;
use std::path::Path;

use veni_fit::LinearTarget;
use veni_fit::encoder::Encoder;
use veni_fit::targets::{read_harmonics, read_surfaces};
use veni_light::latent::Latent;
use veni_light::model::{Array, Model, ModelConfig, ModelInfo, StoredType, decoder_schema};
use veni_light::sphere::Equirect;

use super::{Target, untouched};

pub(super) const TARGETS: &[Target] = &[
    Target { name: "model", run: model, seeds: models, repair: untouched },
    Target { name: "latent", run: latent, seeds: latents, repair: untouched },
    Target { name: "target", run: target, seeds: light_targets, repair: untouched },
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

/// What a fit is to reach, in either form, as far as the sums over its light.
fn target(path: &Path) -> bool {
    let grid = || LinearTarget::new(Equirect::new(8, 4));
    let harmonics = read_harmonics(path).and_then(|wanted| grid().harmonics(&wanted));
    let surfaces = read_surfaces(path).and_then(|wanted| grid().surfaces(&wanted));
    for target in harmonics.iter().chain(&surfaces) {
        let achieved = target.achieved(&[0.0; 3 * 32]);
        assert!(achieved.harmonics.len() + achieved.surfaces.len() > 0);
    }
    harmonics.is_ok() || surfaces.is_ok()
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

fn light_targets() -> Vec<Vec<u8>> {
    let lists: [&[u8]; 3] = [
        br#"{"sun":null,"sh":[[1,1,1],[0.1,0.2,0.3],[0,0,-0.5],[1e-3,0,0]],"irradiance":{"up":[1,2,3],"left":[4,5,6]}}"#,
        br"[[1,2,3]]",
        br#"[{"normal":[0,0,1],"irradiance":[1,2,3]},{"normal":[1,0,-2],"illuminance":5e3}]"#,
    ];
    lists.map(<[u8]>::to_vec).to_vec()
}
