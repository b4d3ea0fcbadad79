//! Light a scene with a learned prior of natural outdoor light.
//!
//! | here | crate | feature |
//! |---|---|---|
//! | [`sphere`], [`latent`], [`model`], [`field`], [`light`] | veni-light: what a renderer embeds | |
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

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
