//! From panoramas to latents without a tensor library: the VENI encoder in plain f32.
//!
//! [`Encoder`] gives for a panorama the means of its latent vectors and their variances, as the network that was
//! trained does, up to rounding. It allocates a few megabytes, runs at the widest SIMD that the processor has, and
//! builds for WebAssembly (without the feature `parallel`, which is on by default and uses all cores).
//!
//! ```no_run
//! use veni_core::{model::Model, sphere::Equirect};
//!
//! let encoder = veni_fit::Encoder::new(&Model::load("model.safetensors")?)?;
//! let log_radiance = vec![0.0; 3 * 128 * 64];
//! let encoded = encoder.encode(Equirect::new(128, 64), &[&log_radiance])?;
//! println!("{:?}", encoded[0].vectors);
//! # Ok::<(), veni_core::Error>(())
//! ```

#![forbid(unsafe_code)]

pub mod encoder;

pub use encoder::{Encoded, Encoder};
