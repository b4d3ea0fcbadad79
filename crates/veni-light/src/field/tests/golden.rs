//! Numbers of the reference implementation. Their tolerance rule: |ours − golden| ≤ max(10 f32_err, 1e-6 + 1e-5 max_abs).
//!
//! Their directions and latents are used as they stand: the decoder needs them in one frame, whichever it is.

use std::collections::BTreeMap;
use std::path::PathBuf;

use safetensors::SafeTensors;
use serde_json::Value;

use super::distance;
use crate::latent::Latent;
use crate::model::{Array, DecoderConfig, Model, ModelConfig, ModelInfo, VnReluForm, decoder_schema};

struct Case {
    name: String,
    tensors: BTreeMap<String, Array>,
    config: Value,
    tolerances: Value,
}

impl Case {
    fn read(name: &str) -> Self {
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden");
        let bytes = std::fs::read(folder.join(format!("{name}.safetensors"))).unwrap();
        let (_, metadata) = SafeTensors::read_metadata(&bytes).unwrap();
        let entry = |key: &str| -> Value {
            let entries = metadata.metadata().as_ref().unwrap();
            entries.get(key).map_or(Value::Null, |text| serde_json::from_str(text).unwrap())
        };
        let (config, tolerances) = (entry("config"), entry("tol"));
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let floats = file.iter().filter(|(_, view)| view.dtype() == safetensors::Dtype::F32);
        let tensors = floats.map(|(key, view)| {
            let data = view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
            (key.to_owned(), Array { shape: view.shape().to_vec(), data })
        });
        Self { name: name.into(), tensors: tensors.collect(), config, tolerances }
    }

    fn triples(&self, key: &str) -> Vec<[f32; 3]> {
        self.tensors[key].data.as_chunks::<3>().0.to_vec()
    }

    fn size(&self, key: &str) -> usize {
        self.config[key].as_u64().unwrap() as usize
    }

    fn model_config(&self, vn_relu: VnReluForm) -> ModelConfig {
        let (hidden, layers) = (self.size("hidden_features"), self.size("num_attention_layers"));
        let decoder = DecoderConfig {
            hidden,
            layers,
            heads: self.size("num_attention_heads"),
            vn_relu,
            ..DecoderConfig::default()
        };
        ModelConfig { decoder, ..ModelConfig::decode_only(self.size("latent_dim")) }
    }

    /// The file's weights under our names, [out, in] transposed.
    fn model(&self, vn_relu: VnReluForm) -> Model {
        let config = self.model_config(vn_relu);
        let theirs = |ours: &str| {
            let ours = ours.strip_prefix("decoder.").unwrap();
            let fixed = [
                ("condition.scale", "vn_proj_in.1.weight"),
                ("condition.linear", "vn_invar.mlp.0.weight"),
                ("condition.w", "vn_invar.mlp.1.W"),
                ("condition.u", "vn_invar.mlp.1.U"),
            ];
            if let Some((_, key)) = fixed.iter().find(|(name, _)| *name == ours) {
                return format!("param.{key}");
            }
            let parts: Vec<&str> = ours.split('.').collect();
            match parts[..] {
                ["input", kind] => format!("param.network.residual_projection.{kind}"),
                ["output", kind] => format!("param.network.fc.{kind}"),
                ["layers", l, part, kind] => {
                    let kind = if kind == "gamma" {
                        "weight"
                    } else if kind == "beta" {
                        "bias"
                    } else {
                        kind
                    };
                    let part = match part {
                        "value" => "mha.value",
                        "out" => "mha.fc_out",
                        "ff1" => "fc.0",
                        "ff2" => "fc.2",
                        norm => norm,
                    };
                    format!("param.network.layers.{l}.{part}.{kind}")
                }
                _ => panic!("unknown tensor {ours}"),
            }
        };
        let tensors = decoder_schema(&config).into_iter().map(|(name, shape)| {
            let Array { data, .. } = &self.tensors[&theirs(&name)];
            let data = match shape[..] {
                [inputs, outputs] => {
                    (0..data.len()).map(|i| data[(i % outputs) * inputs + i / outputs]).collect()
                }
                _ => data.clone(),
            };
            (name, Array { shape, data })
        });
        Model::new(config, tensors.collect(), ModelInfo::default()).unwrap()
    }

    fn tolerance(&self, key: &str) -> f32 {
        let part = |part: &str| self.tolerances[key][part].as_f64();
        // the image companion has no metadata of its own: its values stay within ±3
        let (error, largest) = (part("f32_err").unwrap_or(0.0), part("max_abs").unwrap_or(2.0));
        (10.0 * error).max(1e-6 + 1e-5 * largest) as f32
    }

    fn check(&self, key: &str, ours: &[[f32; 3]]) {
        let (worst, allowed) = (distance(ours, &self.triples(key)), self.tolerance(key));
        assert!(worst <= allowed, "{} {key}: worst {worst:e}, allowed {allowed:e}", self.name);
    }
}

fn decode(model: &Model, vectors: &[[f32; 3]], directions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut out = vec![[0.0; 3]; directions.len()];
    let field = model.decoder().unwrap().condition(&Latent::new(vectors.to_vec())).unwrap();
    field.log_radiance_batch(directions, &mut out);
    out
}

#[test]
fn small_decoders() {
    for (name, form) in [
        ("c05_field_attention_vn_so2", VnReluForm::Reference),
        ("c05_guard_veni", VnReluForm::Reference),
        ("c05_guard_renipp", VnReluForm::ReferenceNormGuard),
        ("c05_renipp_small", VnReluForm::ReferenceNormGuard),
    ] {
        let case = Case::read(name);
        let directions = case.triples("in.directions");
        case.check("out.rgb", &decode(&case.model(form), &case.triples("in.latent"), &directions));
    }
}

#[test]
fn scale_is_a_log_exposure() {
    let case = Case::read("c05_renipp_scale");
    let model = case.model(VnReluForm::ReferenceNormGuard);
    let mut latent = Latent::new(case.triples("in.latent"));
    latent.log_exposure = case.tensors["in.scale"].data[0];
    let directions = case.triples("in.directions");
    let mut out = vec![[0.0; 3]; directions.len()];
    model.decoder().unwrap().condition(&latent).unwrap().log_radiance_batch(&directions, &mut out);
    case.check("out.rgb", &out);
}

#[test]
fn full_decoder_on_two_latents_and_an_image() {
    let case = Case::read("c05_veni_decoder_full_d9");
    let model = case.model(VnReluForm::Reference);
    let (latents, directions) = (case.triples("in.latent"), case.triples("in.directions"));
    let ours: Vec<_> = latents.chunks(9).flat_map(|latent| decode(&model, latent, &directions)).collect();
    case.check("out.rgb", &ours);
    let image = Case::read("c05_veni_decoder_full_d9_image");
    let directions = Case::read("c04_decoder_directions").triples("out.decoder_dirs_64x128");
    image.check("out.rgb", &decode(&model, &image.triples("in.latent"), &directions));
}

#[test]
fn filler_decoder_and_its_images() {
    let case = Case::read("c05_decoder_fullsize_d9_filler");
    let seed = case.config["filler_seed"].as_u64().unwrap();
    let model = Model::filler(&case.model_config(VnReluForm::Reference), seed).unwrap();
    case.check("out.rgb", &decode(&model, &case.triples("in.latent"), &case.triples("in.directions")));
    let directions = Case::read("c04_decoder_directions").triples("out.decoder_dirs_64x128");
    for (latent, image) in [("in.latent", "out.image"), ("in.ae_latent", "out.ae_image")] {
        case.check(image, &decode(&model, &case.triples(latent), &directions));
    }
}

/// The three forms of the VN-ReLU are told apart, and so is a wrong weight: the cases above can fail.
#[test]
fn wrong_forms_and_weights_are_caught() {
    let case = Case::read("c05_guard_renipp");
    let (latent, directions) = (case.triples("in.latent"), case.triples("in.directions"));
    let off = |model: &Model| {
        distance(&decode(model, &latent, &directions), &case.triples("out.rgb")) > case.tolerance("out.rgb")
    };
    assert!(!off(&case.model(VnReluForm::ReferenceNormGuard)));
    assert!(off(&case.model(VnReluForm::Reference)));
    assert!(off(&case.model(VnReluForm::Projection)));
    let model = case.model(VnReluForm::ReferenceNormGuard);
    let mut tensors = model.tensors().clone();
    tensors.get_mut("decoder.layers.1.ff2.weight").unwrap().data[5] += 1e-3;
    assert!(off(&Model::new(model.config().clone(), tensors, ModelInfo::default()).unwrap()));
}
