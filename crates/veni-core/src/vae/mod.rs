//! The variational auto-encoder: VN-ViT encoder, posterior, and the conditional neural field as decoder.

mod encoder;
mod posterior;

pub use encoder::{Encoder, FoldedEncoder};
pub use posterior::Posterior;
