//! Expansion by a network that the user brings, in place of the fitted functions.
//!
//! **What the network is given**: one float tensor 1 × 3 × H × W (channels R, G, B; row 0 is up), the panorama's values in
//! [0, 1], sRGB-coded or linear ([`NetworkInput`]). **What it gives**: one float tensor of the same shape, radiance or its
//! natural logarithm ([`NetworkOutput`]), in units of the display's white or in a scale of its own ([`NetworkScale`]). NaN
//! and infinity are errors anywhere, negative radiance where it would be used.
//!
//! **What becomes of it**. With v a stored display value, ℓ its linear value and N the network's radiance for it,
//!
//! > L = ℓ + a (max(N, ℓ) − ℓ),  a = clamp((v − 0.95) / (250/255 − 0.95), 0, 1),
//!
//! per channel: what is not clipped stays as it was recorded, what is clipped is at least as bright as it was recorded,
//! and the ramp between is that of Eilertsen et al., "HDR image reconstruction from a single exposure using deep CNNs", ACM
//! TOG 36(6), 2017.
//!
//! **A panorama has no edges, a network's image does.** Where the network takes any size, the image is continued beyond
//! its own by at least 64 pixels, as the sphere goes on: round the sides, and over the poles half a turn away. Where the
//! width is fixed, the network is run twice, the second time on the panorama rotated by half, and the two are mixed by
//! sin² and cos² of the azimuth, so that neither's edge is seen. At another size than the panorama's own the network sees
//! it resampled, and its radiance is resampled back; what is not clipped keeps its own resolution.

mod blend;
#[cfg(feature = "onnx")]
mod graph_check;
#[cfg(feature = "onnx")]
mod onnx;
#[cfg(all(test, feature = "onnx"))]
mod onnx_file;
#[cfg(all(test, feature = "onnx"))]
mod onnx_tests;
mod surround;
#[cfg(test)]
mod tests;
#[cfg(feature = "onnx")]
mod wire;

use std::fmt::Debug;

use crate::{Error, Result};
use veni_image::{LdrPanorama, Panorama, TransferFunction, tonemap};
use veni_light::sphere::Equirect;

#[cfg(feature = "onnx")]
pub use onnx::OnnxNetwork;

/// Larger panoramas are shown to a network of free size at this one, unless [`NetworkOptions::grid`] names another.
pub const LARGEST: Equirect = Equirect { width: 1024, height: 512 };

/// Display values up to this are kept to the bit.
pub const KEPT: f32 = 0.95;

/// A network that estimates radiance from an image of limited range. `OnnxNetwork` runs ONNX files (feature `onnx`);
/// implement this to run something else.
pub trait ExpansionNetwork: Debug + Send + Sync {
    /// What messages call it: a file's name.
    fn name(&self) -> &str;

    /// \[height, width\] that it is made for; nothing where it takes any.
    fn size(&self) -> [Option<usize>; 2];

    /// Runs it on an image of `size` = \[H, W\]: 3 · H · W values, three planes R, G, B of H rows; the result has the same
    /// layout. It may be called from several threads.
    ///
    /// # Errors
    /// Why it could not be run.
    fn run(&self, planes: Vec<f32>, size: [usize; 2]) -> Result<Vec<f32>>;
}

/// What a network is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NetworkInput {
    /// sRGB-coded values, as an sRGB file stores them.
    #[default]
    Srgb,
    /// Linear values; white is 1.
    Linear,
}

/// What a network gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NetworkOutput {
    /// Linear radiance.
    #[default]
    Linear,
    /// Natural logarithm of linear radiance.
    Log,
}

/// The unit of a network's radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NetworkScale {
    /// The display's white is 1.
    #[default]
    White,
    /// Its own: multiplied by the factor that, in the median, makes it right where nothing is clipped.
    Match,
}

/// How a network is used.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NetworkOptions {
    /// From display values to linear ones.
    pub transfer: TransferFunction,
    /// What it is given.
    pub input: NetworkInput,
    /// What it gives.
    pub output: NetworkOutput,
    /// The unit of that.
    pub scale: NetworkScale,
    /// The size at which a network of free size sees the panorama, before it is continued beyond its edges; without, the
    /// panorama's own, but at most [`LARGEST`].
    pub grid: Option<Equirect>,
}

/// A panorama whose clipped values a network has estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkExpanded {
    /// Linear radiance; 1 is the display's white.
    pub panorama: Panorama,
    /// Share of the sphere that is clipped in at least one channel, 0 to 1.
    pub clipped: f64,
    /// What the network made of it; nothing where nothing was near clipping, and it was not run.
    pub estimate: Option<Estimate>,
}

/// How a network did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The factor its radiance was multiplied by: 1 unless matched.
    pub factor: f32,
    /// Share of the clipped values (solid angle does not count) for which it gave less than what is stored.
    pub below: f64,
}

impl NetworkOptions {
    /// Checks that the network can be run at [`NetworkOptions::grid`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is made for another size.
    pub fn check(&self, network: &dyn ExpansionNetwork) -> Result<()> {
        let Some(grid) = self.grid else { return Ok(()) };
        let [height, width] = network.size();
        if height.is_some_and(|h| h != grid.height) || width.is_some_and(|w| w != grid.width) {
            let side = |side: Option<usize>| side.map_or("any".to_owned(), |n| n.to_string());
            return Err(Error::invalid(format!(
                "is made for images of {} × {} (width × height) and cannot be run at {} × {}: leave the size to it",
                side(width),
                side(height),
                grid.width,
                grid.height
            ))
            .in_file(network.name()));
        }
        Ok(())
    }

    /// The size at which the network sees a panorama.
    fn seen(&self, own: Equirect, network: &dyn ExpansionNetwork) -> Equirect {
        if let Some(grid) = self.grid {
            return grid;
        }
        match network.size() {
            [Some(height), Some(width)] => Equirect::new(width, height),
            [Some(height), None] => Equirect::new(2 * height, height),
            [None, Some(width)] => Equirect::new(width, (width / 2).max(1)),
            [None, None] if own.width > LARGEST.width => LARGEST,
            [None, None] => own,
        }
    }
}

/// [`Expand::expand_by`](super::Expand::expand_by).
pub(super) fn expand_by(
    ldr: &LdrPanorama,
    network: &dyn ExpansionNetwork,
    options: &NetworkOptions,
) -> Result<NetworkExpanded> {
    options.check(network)?;
    let linear = ldr.linear(options.transfer);
    let clipped = blend::clipped(ldr);
    if !ldr.values().as_flattened().iter().any(|v| *v > KEPT) {
        return Ok(NetworkExpanded { panorama: linear, clipped, estimate: None });
    }
    let grid = options.seen(ldr.grid(), network);
    let shown = match (options.input, options.transfer) {
        (NetworkInput::Linear, _) => linear.clone(),
        (NetworkInput::Srgb, TransferFunction::Srgb) if ldr.is_srgb() => {
            Panorama::new(ldr.grid(), ldr.values().to_vec())
        }
        (NetworkInput::Srgb, _) => {
            Panorama::new(ldr.grid(), linear.pixels().iter().map(|p| p.map(tonemap::srgb)).collect())
        }
    };
    let estimate = surround::run(network, &shown.resample(grid), options.output)?;
    let (panorama, estimate) =
        blend::blend(ldr, linear, &estimate.resample(ldr.grid()), network.name(), options.scale)?;
    Ok(NetworkExpanded { panorama, clipped, estimate: Some(estimate) })
}
