//! VENI, a learned prior of natural outdoor illumination (arXiv 2601.14079), in two worlds.
//!
//! The **lighting world** is what a renderer embeds; it knows nothing of tensors or training:
//! `sphere` (directions, frames, grids), [`panorama`] (HDR images), [`latent`] (the code),
//! [`model`] (the weight file), [`field`] (the decoder folded for one latent), [`shade`] (surfaces under that
//! light), [`prepare`] (which panoramas are fit for training) and [`synth`] (generated outdoor scenes).
//!
//! The **learning world** (feature `learn`, on by default) is built on burn: `nn` (equivariant
//! layers), `vae` (encoder and decoder), `data`, `train`, `fit`, `eval` and `baseline`. It uses the
//! lighting world and never the reverse; the bridge between them is the model file.

// what a renderer embeds has none; what trains has the calls in `field::bfloat16` and `data::pixels`
#![cfg_attr(not(feature = "learn"), forbid(unsafe_code))]

pub mod error;
pub mod field;
pub mod latent;
pub mod model;
pub mod output;
pub mod panorama;
pub mod prepare;
pub mod shade;
pub mod sphere;
pub mod synth;

#[cfg(feature = "learn")]
pub mod baseline;
#[cfg(feature = "learn")]
mod cholesky;
#[cfg(feature = "learn")]
pub mod data;
#[cfg(feature = "learn")]
pub mod eval;
#[cfg(feature = "learn")]
pub mod fit;
#[cfg(feature = "learn")]
pub mod nn;
#[cfg(feature = "learn")]
mod parallel;
#[cfg(feature = "learn")]
pub mod train;
#[cfg(feature = "learn")]
pub mod vae;

pub use error::{Error, Result};
