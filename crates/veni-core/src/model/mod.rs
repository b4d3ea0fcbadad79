//! The model: its configuration and its weight file (safetensors with a JSON header).

mod config;

pub use config::{
    DecoderConfig, EncoderConfig, ModelConfig, ModelKind, Pooling, Reduction, StripeSampling, VectorLayer,
    VnReluForm,
};
