//! Presets, overrides and refusals.

use super::*;
use crate::train::presets::Preset;

#[test]
fn presets_survive_their_file() {
    for preset in [Preset::Tiny, Preset::Small, Preset::Paper] {
        for config in [preset.config(9), preset.auto_decoder(9)] {
            config.check().unwrap();
            assert_eq!(TrainConfig::from_toml(&config.to_toml().unwrap()).unwrap(), config);
        }
    }
}

#[test]
fn overrides_reach_every_level_and_keep_types() {
    let config = Preset::Small.config(9);
    let changed = config
        .with_overrides(&[
            "steps=500",
            "loss.kld=1",
            "model.encoder.depth=2",
            "device=ndarray",
            "order = shuffle",
        ])
        .unwrap();
    assert_eq!(changed.steps, 500);
    assert_eq!(changed.loss.kld, veni_fit::schedule::WeightSchedule::Constant(1.0));
    assert_eq!(changed.model.encoder.as_ref().unwrap().depth, 2);
    assert_eq!((changed.device, changed.order), (DeviceKind::Ndarray, Order::Shuffle));
    assert_eq!(changed.decoder.learning_rate.at(500), config.decoder.learning_rate.at(config.steps));
    let grid = config.with_overrides(&[r#"loss_grid={kind="averaged", factor=4}"#]).unwrap();
    assert_eq!(grid.loss_grid, LossGrid::Averaged { factor: 4 });
}

#[test]
fn what_is_wrong_is_named() {
    let config = Preset::Small.config(9);
    let refused = |text: &str| config.with_overrides(&[text]).unwrap_err().to_string();
    assert!(refused("stepz=5").contains("stepz"));
    assert!(refused("loss.nothing.deeper=5").contains("nothing"));
    assert!(refused("steps").contains("no `=`"));
    assert!(refused("steps=many").contains("steps=many"));
    let checked = |text: &str| config.with_overrides(&[text]).unwrap().check().unwrap_err().to_string();
    assert!(checked("loss_grid.factor=3").contains("loss_grid.factor = 3"));
    assert!(checked("batch=0").contains("batch = 0"));
    assert!(checked("ema_decay=1.0").contains("ema_decay = 1"));
    assert!(checked("augment.mix=2.0").contains("augment.mix = 2"));
}

#[test]
fn keys_of_earlier_files_are_read_by_their_present_names() {
    let old = ["loss.level=0.25", "decoder_by=tensors", "stage.a.loss.level=0.5"];
    let new = ["loss.exposure=0.25", "decoder_backend=tensors", "stage.a.loss.exposure=0.5"];
    let mut config = Preset::Small.config(9);
    config.stage = vec![stage("a", config.steps, "")];
    let config = config.with_overrides(&new).unwrap();
    let same = Preset::Small.config(9);
    let same = TrainConfig { stage: vec![stage("a", same.steps, "")], ..same }.with_overrides(&old).unwrap();
    assert_eq!(same, config);
    assert_ne!(config.loss, Preset::Small.config(9).loss);

    let text = config.to_toml().unwrap();
    // of the loss, not of the augmentation
    let former = text.replace("exposure = 0.25", "level = 0.25").replace("exposure = 0.5", "level = 0.5");
    let former = former.replace("decoder_backend", "decoder_by");
    assert!(former.contains("level = 0.25") && former.contains("level = 0.5"), "{former}");
    let read = TrainConfig::from_toml(&former).unwrap();
    assert_eq!((&read.loss, read.decoder_backend), (&config.loss, config.decoder_backend));
    assert_eq!(read.stages().unwrap()[0].config.loss, config.stages().unwrap()[0].config.loss);
}

#[test]
fn what_belongs_to_the_other_system_is_refused() {
    let refused = |config: &TrainConfig, text: &[&str]| {
        config.with_overrides(text).unwrap().check().unwrap_err().to_string()
    };
    let reni = Preset::Small.auto_decoder(9);
    assert!(refused(&reni, &["augment.mirror=0.5"]).contains("augment"));
    assert!(refused(&reni, &["loss.mage=0.5"]).contains("loss.mage"));
    assert!(refused(&reni, &["model.kind=veni"]).contains("model.encoder is missing"));
    assert!(refused(&reni, &["latents.rays=3"]).contains("latents.rays = 3"));
    assert!(refused(&Preset::Small.config(9), &["model.kind=reni"]).contains("model.encoder"));
    let mut veni = Preset::Small.config(9);
    veni.latents.clone_from(&reni.latents);
    assert!(veni.check().unwrap_err().to_string().contains("latents"));
    let short = reni.with_overrides(&["steps=500"]).unwrap().latents.unwrap().optimiser.learning_rate;
    assert_eq!(short.at(500), reni.latents.unwrap().optimiser.learning_rate.at(reni.steps));
}

fn stage(name: &str, steps: u64, changes: &str) -> StageConfig {
    StageConfig { name: name.to_owned(), steps, changes: changes.parse().unwrap() }
}

#[test]
fn a_stage_is_the_run_with_its_changes() {
    let mut config = Preset::Small.config(9);
    config.data.folders = vec!["real".into()];
    config.data.fold = Some("2/4".parse().unwrap());
    let rate = config.decoder.learning_rate;
    config.set_steps(500);
    config.stage = vec![
        stage(
            "a",
            300,
            "loss.kld = 1\nloss.mage = {centre = 5, width = 2, weight = 1}\ndata.folders = ['ldr']",
        ),
        stage("b", 200, "decoder.learning_rate = {kind = 'constant', rate = 1e-5}\naugment.mix = 0"),
    ];
    config.check().unwrap();
    assert_eq!(TrainConfig::from_toml(&config.to_toml().unwrap()).unwrap(), config);
    let [a, b] = &config.stages().unwrap()[..] else { panic!("two stages") };
    assert_eq!((a.first, a.end(), b.first, b.end()), (0, 300, 300, 500));
    assert_eq!((a.own_data, b.own_data), (true, false));
    assert_eq!((a.config.data.folders[0].to_str(), a.config.data.val_share), (Some("ldr"), 0.0));
    // of other folders nothing is held back
    assert_eq!((a.config.data.fold, b.config.data.fold), (None, config.data.fold));
    assert_eq!(b.config.data, config.data);
    assert_eq!(a.config.loss.kld, veni_fit::schedule::WeightSchedule::Constant(1.0));
    assert!(matches!(a.config.loss.mage, veni_fit::schedule::WeightSchedule::Sigmoid { .. }));
    assert_eq!(b.config.loss, config.loss);
    assert_eq!(b.config.decoder.learning_rate, LearningRate::Constant { rate: 1e-5 });
    assert_eq!((a.config.augment.mix, b.config.augment.mix), (config.augment.mix, 0.0));
    // what fell until the run's last step falls until the stage's
    assert_eq!(a.config.decoder.learning_rate.at(300), rate.at(12_000));
    assert_eq!(b.config.encoder.as_ref().unwrap().learning_rate.at(200), rate.at(12_000));
    assert_eq!(a.config.seed, config.seed);
    assert_ne!(b.config.seed, config.seed);
    // a single setting of a stage, and its steps with the run's
    let changed =
        config.with_overrides(&["stage.b.steps=250", "stage.b.encoder.learning_rate.rate=1e-6"]).unwrap();
    changed.check().unwrap();
    assert_eq!((changed.steps, changed.stages().unwrap()[1].end()), (550, 550));
    assert_eq!(changed.stages().unwrap()[1].config.encoder.as_ref().unwrap().learning_rate.at(200), {
        let LearningRate::Cosine { warm_up, floor, .. } = rate else { panic!("small's schedule") };
        LearningRate::Cosine { rate: 1e-6, warm_up, steps: 250, floor, periodic: false }.at(200)
    });
}

#[test]
fn stages_that_do_not_fit_are_named() {
    let refused = |stages: &[StageConfig]| {
        let mut config = Preset::Tiny.config(3);
        config.set_steps(stages.iter().map(|stage| stage.steps).sum());
        config.stage = stages.to_vec();
        config.check().unwrap_err().to_string()
    };
    for (stages, words) in [
        (vec![stage("a", 1, "seed = 4")], ["stage a", "seed"]),
        (vec![stage("a", 1, "losss.kld = 4")], ["stage a", "losss"]),
        (vec![stage("a", 1, "loss.kdl = 4")], ["stage a", "kdl"]),
        (vec![stage("a", 1, "batch = 0")], ["stage a", "batch = 0"]),
        (vec![stage("a", 1, ""), stage("a", 1, "")], ["stage a", "two stages"]),
        (vec![stage("a", 0, "")], ["stage a", "steps = 0"]),
        (vec![stage("a.b", 1, "")], ["stage a.b", "letters"]),
    ] {
        let message = refused(&stages);
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
    let mut config = Preset::Tiny.config(3);
    config.stage = vec![stage("a", 1, "")];
    let message = config.check().unwrap_err().to_string();
    assert!(message.contains("steps = 200") && message.contains("make 1"), "{message}");
    let wrong = config.with_overrides(&["stage.b.batch=2"]).unwrap_err().to_string();
    assert!(wrong.contains("no stage `b`"), "{wrong}");
    let mut reni = Preset::Tiny.auto_decoder(3);
    reni.stage = vec![stage("a", 200, "data.folders = ['x']")];
    assert!(reni.check().unwrap_err().to_string().contains("(init)"));
    reni.stage = vec![stage("a", 200, "latents.free_exposure = true")];
    assert!(reni.check().unwrap_err().to_string().contains("free_exposure"));
    reni.stage = vec![stage("a", 200, "decoder.learning_rate.rate = 1e-5")];
    reni.check().unwrap();
}

#[test]
fn pretraining_is_a_stage_before_with_ten_times_the_rates() {
    for preset in [Preset::Tiny, Preset::Small, Preset::Paper] {
        let mut config = preset.config(9);
        config.data.folders = vec!["real".into()];
        let own = config.clone();
        let two = config.pretrained_on(&["ldr".into(), "skies".into()], 7, 50_000).unwrap();
        let [first, second] = &two.stages().unwrap()[..] else { panic!("two stages") };
        assert_eq!(two.steps, 50_000 + own.steps);
        assert_eq!(first.config.data.folders, ["ldr", "skies"].map(std::path::PathBuf::from));
        assert_eq!((first.config.data.synthetic, own.data.synthetic), (7, 0));
        assert_eq!(second.config.data, own.data);
        for (group, before) in second.config.groups().into_iter().zip(own.groups()) {
            for step in [300, own.steps] {
                let (low, high) = (group.1.learning_rate.at(step), before.1.learning_rate.at(step));
                assert!((low - high / 10.0).abs() < 1e-15, "{}: {low} and {high}", group.0);
            }
        }
        let LearningRate::Cosine { rate, .. } = second.config.decoder.learning_rate else {
            panic!("a cosine")
        };
        assert!(preset != Preset::Paper || rate == 1e-5, "the reference's rate: {rate}");
        assert!(two.pretrained_on(&["ldr".into()], 0, 1).unwrap_err().to_string().contains("pretrain"));
    }
    assert!(Preset::Tiny.auto_decoder(3).pretrained_on(&["ldr".into()], 0, 1).is_err());
}

#[test]
fn accumulation_divides_a_batch_of_panoramas() {
    let config = Preset::Small.config(9);
    let checked = |text: &[&str]| config.with_overrides(text).unwrap().check();
    checked(&["accumulate=2"]).unwrap();
    assert!(checked(&["accumulate=5"]).unwrap_err().to_string().contains("accumulate = 5"));
    assert!(checked(&["accumulate=0"]).unwrap_err().to_string().contains("accumulate = 0"));
    let reni = Preset::Small.auto_decoder(9).with_overrides(&["accumulate=2"]).unwrap();
    assert!(reni.check().unwrap_err().to_string().contains("latents.rays"));
    assert!(!config.to_toml().unwrap().contains("accumulate"), "what is not used is not written");
}

#[test]
fn devices_share_a_batch_of_panoramas() {
    let config = Preset::Small.config(9);
    let checked = |text: &[&str]| config.with_overrides(text).unwrap().check();
    for fine in [&["devices=0,1"][..], &["devices=3"], &["devices=3,0, 1"], &["devices=0,1", "accumulate=2"]]
    {
        checked(fine).unwrap();
    }
    for (bad, said) in [
        (&["devices=0,1,2,3,4"][..], "batch = 4 cannot be shared among 5;"),
        (&["devices=0,1", "accumulate=3"], "in 3 parts each"),
        (&["devices=0,1", "batch=1"], "batch = 1"),
    ] {
        let message = checked(bad).unwrap_err().to_string();
        assert!(message.contains(said), "{bad:?}: {message}");
    }
    for (bad, said) in [("", "not numbers"), ("0,2,0", "0 is named twice"), ("0,x", "0,x"), ("-1", "-1")] {
        let message = bad.parse::<Devices>().unwrap_err().to_string();
        assert!(message.contains(said) && message.contains("such as 0,1"), "{bad}: {message}");
    }
    let reni = Preset::Small.auto_decoder(9).with_overrides(&["devices=0,1"]).unwrap();
    assert!(reni.check().unwrap_err().to_string().contains("whole batch"));
    assert!(!config.to_toml().unwrap().contains("devices"), "what is not used is not written");
    let two = config.with_overrides(&["devices=0,1"]).unwrap();
    assert_eq!(TrainConfig::from_toml(&two.to_toml().unwrap()).unwrap(), two);
    // cards are not threads: another kind of device begins at its first
    assert_eq!(two.with_overrides(&["device=wgpu"]).unwrap().devices, Devices::default());
    assert_eq!(config.with_overrides(&["devices=1,2", "device=wgpu"]).unwrap().devices.numbers(), [1, 2]);
}

#[test]
fn threads_are_shared_where_a_batch_can_be_shared_evenly() {
    let shared = |overrides: &[&str], threads: usize| {
        let mut config = Preset::Small.config(9).with_overrides(overrides).unwrap();
        config.share_threads(threads);
        config.check().unwrap();
        config.devices.count()
    };
    assert_eq!([1, 2, 3, 4, 16].map(|threads| shared(&[], threads)), [1, 2, 2, 4, 4]);
    assert_eq!([2, 5, 9].map(|threads| shared(&["batch=5"], threads)), [1, 5, 5]);
    assert_eq!(shared(&["accumulate=2"], 16), 2);
    assert_eq!(shared(&["device=wgpu"], 16), 1);
    let mut staged = Preset::Small.config(9).pretrained_on(&["ldr".into()], 0, 10).unwrap();
    staged = staged.with_overrides(&["stage.pretrain.batch=6"]).unwrap();
    staged.share_threads(4);
    assert_eq!(staged.devices.numbers(), [0, 1], "of batches of 6 and 4");
    let mut reni = Preset::Small.auto_decoder(9);
    reni.share_threads(16);
    assert_eq!(reni.devices, Devices::default());
}
