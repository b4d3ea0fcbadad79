//! The models: the decoder (a RENI++ field), the encoder (VN-ViT), and both together.

pub mod decoder;
pub mod weights;

pub use decoder::Decoder;
