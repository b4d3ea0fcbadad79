//! What a baseline is fitted to.

use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// The quantity that a baseline expands, and in which its squared error is least.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TargetSpace {
    /// ln L: relative errors count. The strong choice for images of many magnitudes.
    #[default]
    Log,
    /// L itself: absolute errors count, so the sun decides.
    Linear,
}

/// ln of the smallest positive f32 is −103.3; beyond ±this no radiance lies, and squares in f64 stay finite within.
const LARGEST: f32 = 104.0;

/// An image on the sphere, ready to be fitted, in f64.
#[derive(Clone, Debug)]
pub(super) struct Target {
    /// Unit directions of the pixel centres.
    pub(super) directions: Vec<[f64; 3]>,
    /// Share of each pixel in the sphere; they sum to 1.
    pub(super) weights: Vec<f64>,
    /// ln L or L.
    pub(super) values: Vec<[f64; 3]>,
    /// The smallest angle between two neighbouring rows or columns on the equator, radians.
    pub(super) spacing: f64,
}

impl Target {
    /// The image `log_radiance`, `[height, width, 3]`, on `grid`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it does not have 3·W·H values, or one is not the logarithm of an f32.
    pub(super) fn new(grid: Equirect, log_radiance: &[f32], space: TargetSpace) -> Result<Self> {
        let Equirect { width, height } = grid;
        if log_radiance.len() != 3 * grid.len() {
            return Err(Error::invalid(format!(
                "{} values for a {width} × {height} image of three channels; give {}",
                log_radiance.len(),
                3 * grid.len()
            )));
        }
        if let Some(k) = log_radiance.iter().position(|v| v.is_nan() || v.abs() > LARGEST) {
            return Err(Error::invalid(format!(
                "log radiance {} at column {}, row {} is of no f32 radiance; clean the image before a fit",
                log_radiance[k],
                k / 3 % width,
                k / 3 / width
            )));
        }
        let value = |v: f32| match space {
            TargetSpace::Log => f64::from(v),
            TargetSpace::Linear => f64::from(v).exp(),
        };
        let share = |row| grid.solid_angle(row) / (4.0 * std::f64::consts::PI);
        Ok(Self {
            directions: grid.directions().into_iter().map(|d| d.map(f64::from)).collect(),
            weights: (0..height).flat_map(|row| std::iter::repeat_n(share(row), width)).collect(),
            values: log_radiance.as_chunks::<3>().0.iter().map(|p| p.map(value)).collect(),
            spacing: (std::f64::consts::PI / height as f64).min(2.0 * std::f64::consts::PI / width as f64),
        })
    }
}
