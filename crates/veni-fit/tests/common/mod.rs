//! Models of random weights, for tests and measurements.

use std::collections::BTreeMap;

use veni_fit::encoder::encoder_schema;
use veni_light::model::{
    Array, DecoderConfig, EncoderConfig, Model, ModelConfig, ModelInfo, ModelKind, decoder_schema,
};

/// The encoder's configuration beside the smallest decoder.
pub(crate) fn config(encoder: EncoderConfig, latent_vectors: usize) -> ModelConfig {
    let decoder = DecoderConfig { hidden: 8, layers: 1, heads: 1, ..DecoderConfig::default() };
    ModelConfig { kind: ModelKind::Veni, latent_vectors, decoder, encoder: Some(encoder), lights: 0 }
}

/// Numbers between −1 and 1 that a seed fixes.
pub(crate) fn numbers(seed: u32) -> impl FnMut() -> f32 {
    let mut state = u64::from(seed) + 1;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 8_388_608.0 - 1.0
    }
}

/// Weights of variance 1 / (rows of the matrix).
pub(crate) fn tensors(config: &ModelConfig) -> BTreeMap<String, Array> {
    let encoder = encoder_schema(config).expect("a valid configuration");
    let mut number = numbers(1);
    let mut random = |shape: Vec<usize>| {
        let scale = (3.0 / shape[0] as f32).sqrt();
        Array { data: (0..shape.iter().product()).map(|_| scale * number()).collect(), shape }
    };
    let all = decoder_schema(config).into_iter().chain(encoder);
    all.map(|(name, shape)| (name, random(shape))).collect()
}

/// A model of [`tensors`].
pub(crate) fn model(encoder: EncoderConfig, latent_vectors: usize) -> Model {
    let config = config(encoder, latent_vectors);
    let tensors = tensors(&config);
    Model::new(config, tensors, ModelInfo::default()).expect("the tensors of the schema")
}
