//! Latents from pictures, without burn.
//!
//! | here | what |
//! |---|---|
//! | [`Encoder`] | the VN-ViT in plain f32: from a panorama to the posterior over latents |
//! | [`fit()`], [`fit_lobes`], [`fit_rendered`] | latent optimisation under the folded decoder, of panoramas, parts of them, photographs, lit surfaces |
//! | [`fit_linear`], [`LinearTarget`] | the same of harmonics, irradiance and illuminance alone; [`targets`] reads them |
//! | [`Observation`] | from a picture to what can be fitted |
//! | [`unseen`] | the fit of what shows part of the sphere, and the sun that is likely outside of it |
//! | [`shade`] | what a surface looks like under distant light, and the gradient of that |
//! | [`loss`], [`schedule`] | settings that training shares |
//!
//! ```no_run
//! use veni_light::{model::Model, sphere::Equirect};
//!
//! let encoder = veni_fit::Encoder::new(&Model::load("model.safetensors")?)?;
//! let log_radiance = vec![0.0; 3 * 128 * 64];
//! let encoded = encoder.encode(Equirect::new(128, 64), &[&log_radiance])?;
//! println!("{:?}", encoded[0].vectors);
//! # Ok::<(), veni_light::Error>(())
//! ```

#![forbid(unsafe_code)]

mod adam;
mod calibration;
pub mod encoder;
mod fit;
pub mod limits;
pub mod loss;
mod observation;
pub mod schedule;
pub mod shade;
pub mod targets;
pub mod unseen;

pub use adam::Adam;
pub use calibration::lit_exposure;
pub use encoder::{Encoded, Encoder};
pub use fit::{
    Achieved, Best, DecoderPasses, FitConfig, FitResult, FitTarget, LatentDecoder, LatentGradient,
    LinearTarget, LobePlan, Method, Objective, PanoramaLoss, Plateau, Received, WIDEST_LIGHT, best_light,
    best_linear, best_of, fit, fit_linear, fit_lobes, fit_rendered, fit_with, from_each, likely_linear,
    likely_searches, matching_exposure, random_starts, refine_linear,
};
pub use observation::Observation;
pub use veni_light::{Error, Result};
