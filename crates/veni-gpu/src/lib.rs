//! The VENI decoder on the GPU, inside the host's own frame.
//!
//! A [`GpuDecoder`] holds a model's weights on the host's `wgpu::Device`.
//! [`condition`](decoder::GpuDecoder::condition) folds a latent on the CPU and uploads a few kilobytes;
//! [`bake`](decoder::GpuDecoder::bake) records a compute pass into the host's command encoder: a panorama, cube
//! faces, or radiances for a buffer of directions, with the compact lights and lobes of the latent, or without its lights
//! for hosts that draw them as their own. Nothing here creates an instance, submits, or installs an error
//! handler, except the conveniences in [`read_back`], [`adapters`] and [`probe`], which say so.
//!
//! A [`GpuLight`] holds a light's alias table and radiance for `veni_sample_light` and its kin, which a path tracer's own shader
//! includes.
//!
//! A [`GpuPrefilter`] records what turns latents into spherical harmonics and prefiltered cube maps, without leaving the device.
//!
//! [`shader`] has no wgpu types: WGSL text, sizes, binding layouts and packed weights for any API, and the function
//! `veni_radiance` to paste into a path tracer. It is all that is left without the feature `wgpu`.
//!
//! This crate must not depend on burn (checked by `scripts/check-worlds.sh`).

#![forbid(unsafe_code)]

pub mod shader;

#[cfg(feature = "wgpu")]
pub mod adapters;
#[cfg(feature = "wgpu")]
mod buffers;
#[cfg(feature = "wgpu")]
pub mod decoder;
#[cfg(feature = "wgpu")]
pub mod error;
#[cfg(feature = "wgpu")]
pub mod light;
#[cfg(feature = "wgpu")]
pub mod prefilter;
#[cfg(feature = "wgpu")]
pub mod probe;
#[cfg(feature = "wgpu")]
pub mod read_back;
#[cfg(feature = "wgpu")]
mod scope;

#[cfg(feature = "wgpu")]
pub use decoder::{Bake, GpuDecoder, GpuLatents};
#[cfg(feature = "wgpu")]
pub use error::{Error, Result};
#[cfg(feature = "wgpu")]
pub use light::GpuLight;
#[cfg(feature = "wgpu")]
pub use prefilter::{GpuHarmonics, GpuPrefilter, PrefilteredCube};
#[cfg(feature = "wgpu")]
pub use wgpu;
