//! Files that come back as they went, and files that are refused.

use super::*;
use crate::latent::{Latent, Prior};
use crate::output::Overwrite;

fn small() -> Model {
    let decoder = DecoderConfig {
        hidden: 16,
        layers: 2,
        heads: 4,
        vn_relu: VnReluForm::Reference,
        ..DecoderConfig::default()
    };
    let info = ModelInfo {
        training: Some(Training { data: "four skies".into(), steps: 9, seed: 42, ..Training::default() }),
        prior: None,
        licence: Some("CC0-1.0".into()),
    };
    let mut model = Model::filler(&ModelConfig { decoder, ..ModelConfig::decode_only(5) }, 3).unwrap();
    model.set_info(info);
    model
}

/// `small` with an encoder that only veni-core could check.
fn with_encoder() -> Model {
    let model = small();
    let config = ModelConfig { encoder: Some(EncoderConfig::default()), ..model.config().clone() };
    let mut tensors = model.tensors().clone();
    tensors.insert("encoder.anything".into(), Array { shape: vec![2, 1, 3], data: vec![0.1; 6] });
    Model::new(config, tensors, model.info().clone()).unwrap()
}

fn changed(change: impl FnOnce(&mut ModelConfig, &mut BTreeMap<String, Array>)) -> Result<Model> {
    let model = small();
    let (mut config, mut tensors) = (model.config().clone(), model.tensors().clone());
    change(&mut config, &mut tensors);
    Model::new(config, tensors, ModelInfo::default())
}

#[test]
fn single_precision_comes_back_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let mut model = with_encoder();
    let codes: Vec<_> = (0..20).map(|seed| Latent::from_seed(&Prior::standard(5), seed)).collect();
    let prior = Prior::fit(&codes, None).unwrap();
    model.set_prior(&prior).unwrap();
    model.save(&path, StoredType::F32, Overwrite::Refuse).unwrap();
    let back = Model::load(&path).unwrap();
    assert_eq!(back, model);
    assert_eq!(back.prior(), prior);
    assert!(back.has_encoder() && back.has_prior());
    assert!(model.save(&path, StoredType::F32, Overwrite::Refuse).is_err());
    let decode_only = back.without_encoder();
    assert!(!decode_only.has_encoder() && decode_only.has_prior());
    decode_only.save(&path, StoredType::F32, Overwrite::Replace).unwrap();
    assert_eq!(Model::load(&path).unwrap(), decode_only);
}

#[test]
fn half_precision_rounds_once() {
    let model = small();
    let half = Model::from_bytes(&model.to_bytes(StoredType::F16).unwrap()).unwrap();
    let again = Model::from_bytes(&half.to_bytes(StoredType::F16).unwrap()).unwrap();
    assert_eq!(half, again);
    for (name, tensor) in model.tensors() {
        for (a, b) in tensor.data.iter().zip(&half.tensors()[name].data) {
            assert!((a - b).abs() <= a.abs() / 2048.0 + 3e-8, "{name}: {a} became {b}");
        }
    }
    let large = changed(|_, t| t.get_mut("decoder.output.bias").unwrap().data[1] = 70_000.0).unwrap();
    let error = large.to_bytes(StoredType::F16).unwrap_err().to_string();
    assert!(error.contains("decoder.output.bias") && error.contains("70000"), "{error}");
    large.to_bytes(StoredType::F32).unwrap();
}

#[test]
fn the_hash_names_the_decoder_and_only_it() {
    let model = small();
    let hash = model.hash();
    assert_eq!(hash.len(), 16);
    assert_eq!(with_encoder().hash(), hash);
    let half = Model::from_bytes(&model.to_bytes(StoredType::F16).unwrap()).unwrap();
    assert_eq!(half.hash(), hash);
    let other = changed(|_, t| t.get_mut("decoder.output.bias").unwrap().data[1] += 0.01).unwrap();
    assert_ne!(other.hash(), hash);
    assert_ne!(changed(|c, _| c.decoder.vn_relu = VnReluForm::Projection).unwrap().hash(), hash);
}

#[test]
fn wrong_tensors_are_named_with_their_shapes() {
    type Change = fn(&mut ModelConfig, &mut BTreeMap<String, Array>);
    let cases: [(Change, &[&str]); 9] = [
        (|_, t| drop(t.remove("decoder.layers.1.ff2.bias")), &["layers.1.ff2.bias", "[16]", "missing"]),
        (|c, _| c.latent_vectors = 6, &["decoder.input.weight", "[35, 16]", "[40, 16]"]),
        (|c, _| c.decoder.layers = 1, &["decoder.layers.1", "unexpected"]),
        (|c, _| c.decoder.layers = 0, &["decoder.layers = 0"]),
        (|c, _| c.decoder.hidden = 1 << 40, &["decoder.hidden", "8192"]),
        (|_, t| t.get_mut("decoder.output.bias").unwrap().data.truncate(2), &["output.bias", "2 values"]),
        (
            |_, t| t.get_mut("decoder.output.bias").unwrap().data[2] = f32::NAN,
            &["output.bias", "value 2", "NaN"],
        ),
        (
            |_, t| drop(t.insert("encoder.x".into(), Array { shape: vec![1], data: vec![0.0] })),
            &["encoder.x", "unexpected"],
        ),
        (
            |_, t| drop(t.insert("prior.z".into(), Array { shape: vec![5, 5], data: vec![0.0; 25] })),
            &["prior.xy_real", "[5, 5]", "missing"],
        ),
    ];
    for (change, says) in cases {
        let error = changed(change).unwrap_err().to_string();
        assert!(says.iter().all(|part| error.contains(part)), "{error} lacks one of {says:?}");
    }
    assert!(small().set_prior(&Prior::standard(4)).is_err());
    assert_eq!(small().prior(), Prior::standard(5));
}

/// `bytes` with `from` replaced by `to` in the header, whose length is kept.
fn patched(from: &str, to: &str) -> Vec<u8> {
    let mut bytes = small().to_bytes(StoredType::F32).unwrap();
    let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).expect("nothing to replace");
    assert_eq!(from.len(), to.len());
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    bytes
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let good = small().to_bytes(StoredType::F32).unwrap();
    let says = |bytes: &[u8], part: &str| {
        let error = Model::from_bytes(bytes).unwrap_err();
        assert!(error.to_string().contains(part), "{error} lacks {part}");
        error
    };
    for length in [0, 7, 8, 100, good.len() - 1] {
        says(&good[..length], "safetensors");
    }
    says(&[0xff; 64], "safetensors");
    let unknown = says(&patched(r#"\"format\":1"#, r#"\"format\":9"#), "format 9");
    assert!(matches!(unknown, Error::Unsupported { .. }));
    says(&patched("z-up", "y-up"), "y-up");
    says(&patched(r#"kind\":\"veni"#, r#"kind\":\"reni"#), "kind");
    says(&patched(r#"\"layers\":2"#, r#"\"layers\":3"#), "layers.2");
    says(&patched(r#""veni""#, r#""xeni""#), "not a veni model file");
    says(&patched(r#"\"heads\""#, r#"\"beads\""#), "beads");
    let error = Model::load("/nowhere/at all.safetensors").unwrap_err();
    assert!(matches!(&error, Error::Io { .. }) && error.to_string().contains("/nowhere/at all"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("short.safetensors");
    std::fs::write(&path, &good[..200]).unwrap();
    assert!(Model::load(&path).unwrap_err().to_string().contains("short.safetensors"));
    // a sparse file of 2 GiB is refused by its size alone
    std::fs::File::create(&path).unwrap().set_len(2 << 30).unwrap();
    assert!(Model::load(&path).unwrap_err().to_string().contains("1024 MiB"));
    let missing = folder.path().join("no folder").join("model.safetensors");
    assert!(small().save(missing, StoredType::F32, Overwrite::Refuse).is_err());
}

#[test]
fn other_stored_types_are_unsupported() {
    use safetensors::tensor::{Dtype, TensorView};
    let json = header::to_json(small().config(), small().info(), false).unwrap();
    let view = TensorView::new(Dtype::F64, vec![1], &[0; 8]).unwrap();
    let metadata = Some([("veni".to_owned(), json)].into_iter().collect());
    let bytes = safetensors::serialize([("decoder.output.bias", view)], metadata).unwrap();
    assert!(
        matches!(Model::from_bytes(&bytes), Err(Error::Unsupported { message, .. }) if message.contains("F64"))
    );
}

#[cfg(feature = "pretrained")]
#[test]
fn embedded_models_decode() {
    for dimension in Model::pretrained_sizes() {
        let model = Model::pretrained_of(dimension).unwrap();
        assert_eq!(3 * model.latent_vectors(), dimension);
        assert!(
            model.has_encoder() && model.has_prior() && model.info().licence.is_some(),
            "{:?}",
            model.info()
        );
        let latent = Latent::from_seed(&model.prior(), 1);
        let radiance = model.decoder().unwrap().condition(&latent).unwrap().radiance([1.0, 0.0, 0.0]);
        assert!(radiance.iter().all(|v| v.is_finite() && *v > 0.0), "{dimension}: {radiance:?}");
    }
    assert_eq!(Some(Model::pretrained()), Model::pretrained_of(27));
    assert_eq!(Model::pretrained_of(28), None);
    let now = Model::pretrained();
    assert_eq!(Model::pretrained_of_hash(&now.hash()), Some(now));
    // latents of earlier versions
    let earlier = Model::pretrained_of_hash("25f38109d2d49697").unwrap();
    assert_eq!((earlier.hash().as_str(), earlier.has_encoder()), ("25f38109d2d49697", false));
    assert_eq!(Model::pretrained_of_hash("0123456789abcdef"), None);
}

#[test]
fn options_at_their_default_are_not_written() {
    // what files held before there were options: their hash, and with it every latent, stays valid
    let written = serde_json::to_string(&DecoderConfig::default()).unwrap();
    assert_eq!(written, r#"{"hidden":128,"layers":6,"heads":8,"vn_relu":"projection"}"#);
    let read = |text: &str| serde_json::from_str::<DecoderConfig>(text);
    assert_eq!(read(&written).unwrap(), DecoderConfig::default());
    let reni = DecoderConfig::reni_2022();
    assert_eq!(read(&serde_json::to_string(&reni).unwrap()).unwrap(), reni);
    assert!(read(r#"{"conditioning":"fim"}"#).unwrap_err().to_string().contains("film"));
    let wrong = |change: fn(&mut DecoderConfig)| {
        let mut config = ModelConfig::decode_only(3);
        change(&mut config.decoder);
        config.validate().unwrap_err().to_string()
    };
    assert!(wrong(|c| c.omega = -1.0).contains("decoder.omega = -1"));
    let heads = wrong(|c| (c.conditioning, c.heads) = (Conditioning::Tokens, 7));
    assert!(heads.contains("decoder.heads = 7") && heads.contains("128"), "{heads}");
}

#[test]
fn a_network_that_does_not_fold_is_refused_by_name() {
    let refused = |change: fn(&mut DecoderConfig), name: &str| {
        let mut config = ModelConfig::decode_only(3);
        change(&mut config.decoder);
        let error = Model::filler(&config, 1).unwrap().decoder().unwrap_err();
        assert!(matches!(error, Error::Unsupported { .. }) && error.to_string().contains(name), "{error}");
    };
    refused(|c| c.conditioning = Conditioning::Film, "decoder.conditioning = film");
    refused(|c| c.conditioning = Conditioning::Tokens, "decoder.conditioning = tokens");
    refused(|c| c.invariance = Invariance::GramMatrix, "decoder.invariance = gram-matrix");
    refused(|c| c.equivariance = Equivariance::So3, "decoder.equivariance = so3");
    refused(|c| c.encoding = Encoding::Both, "decoder.encoding = both");
    refused(|c| c.output = OutputForm::Tanh, "decoder.output = tanh");
}
