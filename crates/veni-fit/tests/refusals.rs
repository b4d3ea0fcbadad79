//! What an encoder refuses, with what words.

#[allow(dead_code, reason = "each user needs a part of it")]
mod common;

use std::collections::BTreeMap;

use common::{config, model, tensors};
use veni_fit::Encoder;
use veni_light::model::{Array, EncoderConfig, Model, ModelConfig, ModelInfo, Reduction, VectorLayer};
use veni_light::sphere::Equirect;

fn small() -> EncoderConfig {
    EncoderConfig {
        stripes: 8,
        samples: Some(16),
        channels: 4,
        depth: 1,
        heads: 1,
        head_channels: 4,
        feedforward: 1,
        ..EncoderConfig::default()
    }
}

fn refusal(config: ModelConfig, tensors: BTreeMap<String, Array>) -> String {
    let model = Model::new(config, tensors, ModelInfo::default()).expect("the model itself is sound");
    Encoder::new(&model).expect_err("must be refused").to_string()
}

#[test]
fn missing_unexpected_and_misshapen_tensors_are_named() {
    let config = config(small(), 5);
    let message = |change: &dyn Fn(&mut BTreeMap<String, Array>)| {
        let mut tensors = tensors(&config);
        change(&mut tensors);
        refusal(config.clone(), tensors)
    };
    let name = "encoder.transformer.layers.0.attention.key.weight";
    assert_eq!(message(&|t| drop(t.remove(name))), format!("tensor {name} [4, 4] is missing"));
    let misshapen = message(&|t| t.get_mut(name).expect("a tensor").shape = vec![2, 8]);
    assert_eq!(misshapen, format!("tensor {name} is [2, 8], the configuration says [4, 4]"));
    let extra = message(&|t| {
        t.insert("encoder.more".into(), Array { shape: vec![1], data: vec![0.0] });
    });
    assert_eq!(extra, "tensor encoder.more [1] is unexpected in this encoder");
    let without = message(&|t| t.retain(|name, _| !name.starts_with("encoder.")));
    assert!(without.contains("no encoder"), "{without}");
}

/// Every tensor of the schema is needed.
#[test]
fn any_missing_tensor_is_noticed() {
    let encoder = EncoderConfig { transformer: VectorLayer::So2, ..small() };
    let config = config(encoder, 5);
    let all = tensors(&config);
    let names: Vec<_> = all.keys().filter(|name| name.starts_with("encoder.")).collect();
    assert_eq!(names.len(), 1 + 3 + 4 * 3 + 2 * 3 + 2 + 2 + 2 * 3);
    for name in names {
        let mut tensors = all.clone();
        tensors.remove(name);
        assert!(refusal(config.clone(), tensors).contains(name));
    }
}

#[test]
fn impossible_configurations_are_refused() {
    let message = |encoder: EncoderConfig| {
        let sound = config(small(), 5);
        let mut other = sound.clone();
        other.encoder = Some(encoder);
        refusal(other, tensors(&sound))
    };
    assert!(message(EncoderConfig { project_out: VectorLayer::Vn, ..small() }).contains("late-split"));
    let early = EncoderConfig { project_in: VectorLayer::Vn, reduction: Reduction::EarlyLearned, ..small() };
    assert!(message(early).contains("project_in"));
    // refused by what the configuration asks for, not by the allocator
    let mut huge = config(small(), 5);
    huge.encoder = Some(EncoderConfig {
        stripes: 1 << 16,
        samples: Some(1 << 20),
        channels: 8192,
        depth: 256,
        heads: 1024,
        head_channels: 1024,
        feedforward: 64,
        ..EncoderConfig::default()
    });
    let error = Model::new(huge, tensors(&config(small(), 5)), ModelInfo::default()).expect_err("too large");
    assert!(error.to_string().contains("are more than the limit"), "{error}");
}

#[test]
fn images_that_do_not_fit_are_refused() {
    let encoder = Encoder::new(&model(small(), 5)).expect("a whole model");
    let grid = Equirect::new(16, 8);
    let message = encoder.encode(grid, &[&[0.0; 3]]).expect_err("too few values").to_string();
    assert_eq!(message, "3 values are not a panorama of 16 × 8 in RGB");
    let (direction, image) = (vec![[0.0; 3]; 17], vec![[0.0; 3]; 16]);
    let forward = |directions: &[[f32; 3]], image: &[[f32; 3]]| {
        encoder.forward(directions, &[image]).expect_err("must be refused").to_string()
    };
    assert!(forward(&direction, &image).contains("whole stripes of 16"));
    assert!(forward(&direction[..0], &image).contains("whole stripes of 16"));
    assert!(forward(&image, &direction).contains("17 samples of log radiance for 16"));
}

#[test]
fn stripes_that_cannot_be_laid_out_are_refused() {
    let message = |encoder: EncoderConfig| {
        let encoder = Encoder::new(&model(encoder, 5)).expect("a whole model");
        let grid = Equirect::new(2, 1);
        encoder.encode(grid, &[&[0.0; 6]]).expect_err("must be refused").to_string()
    };
    assert!(message(EncoderConfig { stripes: 7, ..small() }).contains("cannot be laid out"));
}
