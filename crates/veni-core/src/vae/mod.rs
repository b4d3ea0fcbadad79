//! The models: the decoder (a RENI++ field), the encoder (VN-ViT), and both together.

pub mod decoder;
pub mod encoder;
pub mod posterior;
pub mod reni;
pub mod veni;
#[cfg(test)]
mod veni_tests;
pub mod weights;

pub use decoder::{Decoder, Native};
pub use encoder::{Encoder, FoldedEncoder};
pub use posterior::Posterior;
pub use reni::{LatentTable, Reni};
pub use veni::{Encoded, Veni};
