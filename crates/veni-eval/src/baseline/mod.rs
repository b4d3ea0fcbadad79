//! The systems that VENI is compared with: an image's own expansion in spherical harmonics or spherical Gaussians, given
//! the latent dimension D of a model. No prior, no training, no tensors.
//!
//! | system | what is expanded | coefficients |
//! |---|---|---|
//! | [`BaselineKind::SphericalHarmonics`] | log radiance or radiance ([`TargetSpace`]) | 3(L+1)² |
//! | [`BaselineKind::SphericalGaussians`] | the same, in lobes of either sign | 6 per lobe + 3 |
//! | [`BaselineKind::GaussianMixture`] | radiance, in positive lobes; error in log radiance | 6 per lobe + 3 |
//!
//! All are fitted to the whole sphere with every pixel weighted by its solid angle, in the native frame. The reference
//! implementation's own forms, which golden files test, are in [`harmonics::reference`] and [`gaussians::reference`].
//!
//! ```
//! # use veni_eval::{Result, baseline::{Baseline, BaselineKind, TargetSpace}};
//! # use veni_light::sphere::Equirect;
//! # fn main() -> Result<()> {
//! let grid = Equirect::new(32, 16);
//! let sky: Vec<f32> = grid.directions().iter().flat_map(|d| [d[2], 0.5 * d[0], 1.0]).collect();
//! let baseline = Baseline::from_dimension(BaselineKind::SphericalHarmonics, 27, TargetSpace::Log)?;
//! let fitted = baseline.fit(grid, &sky)?;
//! assert_eq!(fitted.parameters().len(), 27);
//! assert!((fitted.log_radiance(&[[0.0, 0.0, 1.0]])[0][0] - 1.0).abs() < 1e-3);
//! # Ok(())
//! # }
//! ```

mod fitted;
pub mod gaussians;
pub mod harmonics;
mod least_squares;
mod system;
mod target;

pub use fitted::{BaselineField, FLOOR, Fitted};
pub use system::{Baseline, BaselineKind};
pub use target::TargetSpace;
pub use veni_fit::Adam;

#[cfg(test)]
mod tests;
