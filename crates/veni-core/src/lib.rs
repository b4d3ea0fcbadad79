//! VENI on burn: the equivariant layers ([`nn`]), encoder and decoder ([`vae`]), losses and training ([`train`]), latent
//! optimisation under any decoder and objective ([`fit`]), weights of other programs ([`import`]).
//!
//! One entrance to what stands below it, none of which knows burn:
//!
//! | here | crate | what |
//! |---|---|---|
//! | [`sphere`], [`latent`], [`model`], [`field`], [`light`], [`skies`] | veni-light | what a renderer embeds |
//! | [`panorama`] | veni-image | panoramas in and out, colour, tone mapping, metrics |
//! | [`synth`] | veni-synth | generated scenes |
//! | [`fit`], [`shade`] | veni-fit | encoder in plain f32, latent optimisation, rendered surfaces |
//! | [`data`], [`prepare`], [`expand`] | veni-data | panoramas for training |
//!
//! The bridge between training and use is the model file.

#![forbid(unsafe_code)]

pub mod fit;
pub mod import;
pub mod limits;
mod loaded;
pub mod nn;
pub mod train;
pub mod vae;

pub use loaded::{LoadedModel, Rest};
pub use veni_data::{self as data, expand, prepare};
pub use veni_fit::shade;
pub use veni_image as panorama;
pub use veni_light::{
    Error, Result, cholesky, digest, error, field, latent, light, model, output, progress, random, skies,
    sphere, text, vector,
};
pub use veni_synth as synth;
