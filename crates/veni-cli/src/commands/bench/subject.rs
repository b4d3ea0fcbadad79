//! What is measured, whatever device it is.

use std::time::Duration;

use anyhow::Result;
use veni_light::sphere::Equirect;

use super::cases::Case;

/// Something that bakes.
pub(super) trait Subject {
    /// What to call it in results.
    fn name(&self) -> &str;

    /// Its own rate of f32 multiply-adds, floating-point operations per second.
    fn multiply_add_rate(&mut self) -> Result<f64>;

    /// Readies a latent of a model.
    fn load(&mut self, case: &Case) -> Result<Box<dyn Bakes>>;
}

/// A latent, ready to be baked.
pub(super) trait Bakes {
    /// Bakes a panorama: how long that took, preparations for this size not included.
    fn bake(&mut self, grid: Equirect) -> Result<Duration>;
}
