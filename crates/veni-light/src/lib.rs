//! VENI, a learned prior of natural outdoor illumination (arXiv 2601.14079), as a renderer embeds it: no tensors, no
//! training, no image files.
//!
//! | here | what |
//! |---|---|
//! | [`sphere`] | directions, frames, pixel grids, perspective views |
//! | [`latent`] | the code: N vectors in R³, and their prior |
//! | [`model`] | the weight file, and the models inside this crate |
//! | [`field`] | the decoder folded for one latent: radiance in any direction |
//! | [`random`] | streams of random numbers that are the same on every machine |
//! | [`cholesky`] | small dense systems of equations |
//! | [`digest`] | content as one short name |
//! | [`output`] | files that are written beside their target and renamed |

#![cfg_attr(not(feature = "training"), forbid(unsafe_code))]

pub mod cholesky;
pub mod digest;
pub mod error;
pub mod field;
pub mod latent;
pub mod model;
pub mod output;
pub mod random;
pub mod sphere;

pub use error::{Error, Result};
