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
    assert_eq!(changed.loss.kld, crate::train::schedule::WeightSchedule::Constant(1.0));
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
