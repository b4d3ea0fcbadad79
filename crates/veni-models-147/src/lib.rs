//! The bytes of VENI's pretrained model of latent dimension 147 (49 vectors), which veni-light reads.
//!
//! A crate of its own: a package on crates.io holds 10 MB at most, and who wants the smallest model alone downloads it alone.

#![no_std]

/// The model file: safetensors with weights in half precision, decoder and encoder.
pub static FILE: &[u8] = include_bytes!("../assets/veni-147.safetensors");
