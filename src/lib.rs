//! Light a scene with a learned prior of natural outdoor light.
//!
//! | here | crate | feature |
//! |---|---|---|
//! | [`sphere`], [`latent`], [`model`], [`field`], [`light`], [`skies`] | veni-light: what a renderer embeds | |
//! | `gpu` | veni-gpu: the decoder as WGSL compute | `gpu` |
//! | `nn`, `vae`, `train`, `fit`, `data`, `panorama`, `synth` | veni-core and what stands below it | `learn` |
//! | `eval` | veni-eval: protocols, baselines | `learn` |

#![forbid(unsafe_code)]

#[cfg(feature = "learn")]
pub use veni_core::*;
#[cfg(feature = "learn")]
pub use veni_eval as eval;
#[cfg(feature = "gpu")]
pub use veni_gpu as gpu;
#[cfg(not(feature = "learn"))]
pub use veni_light::*;

/// Modules of veni-light are in every build, with `learn` and without; where one is not, this does not compile.
#[allow(unused_imports, reason = "it is asked whether the names exist")]
mod in_every_build {
    use crate::{
        cholesky, digest, error, field, latent, light, limits, model, output, progress, random, skies,
        sphere, text, vector,
    };
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
