//! From limited range to radiance: inverse tone mapping of LDR panoramas.
//!
//! Display values are linearised, which makes white radiance 1, and what is clipped at white is rebuilt in three steps:
//!
//! 1. **Partly clipped channels** take the hue of the nearest pixel that is not clipped, at the brightness that
//!    the channels left tell (the idea of Zhang and Brainard, "Estimation of saturated pixel values in digital
//!    color imaging", JOSA A 21(12), 2004). Blue is the first channel to go in a sky.
//! 2. **Regions clipped in all channels** are given an expand map (Banterle et al., "Inverse tone mapping", GRAPHITE
//!    2006; as in Rempel et al., "Ldr2Hdr", SIGGRAPH 2007, it grows smoothly from the region's border, where it is 1).
//!    Here it is a power of the depth: with d the angle to the border, R the greatest depth and r☉ the sun's radius,
//!    ln L = p x, x = 1 − e^(−d/δ) − ln max(1 − d/R, r☉/R): a shoulder of δ = 0.02 and, for a disc, the (R/r)ᵖ of an
//!    aureole. The exponent p is a linear function of what is known of the region ([`Region::features`]).
//! 3. **The sun**, or whatever shines in the region that reaches deepest above the horizon: its whole energy is predicted by
//!    a second linear function of the same features, and what the map leaves of it becomes a disc of the sun's size.
//!
//! The linear functions are fitted to HDR panoramas that were clipped at several exposures ([`Parameters`],
//! the example `expansion` of veni-research); docs/results/expansion.md says how far the results are from the truth.
//! Whoever has a network for it uses that instead: [`network`].

mod analysis;
mod channels;
mod describe;
mod fitted;
mod nearest;
pub mod network;
mod rebuild;
mod regions;
mod scene;
#[cfg(test)]
mod tests;

use veni_image::{LdrPanorama, Panorama, TransferFunction};

use crate::Result;

pub use analysis::Analysis;
pub use describe::{FEATURES, Region};
pub use fitted::Parameters;

/// Angular radius of the sun, radians.
pub const SUN_RADIUS: f64 = 4.65e-3;

/// A display value from here on counts as clipped: JPEG rings about white by a few steps of 1/255.
pub const CLIPPED: f32 = 250.0 / 255.0;

/// How an LDR panorama is expanded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExpandOptions {
    /// From display values to linear ones.
    pub transfer: TransferFunction,
    /// What the linear functions are.
    pub parameters: Parameters,
}

/// A panorama with its range rebuilt, and what was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Expanded {
    /// Linear radiance; 1 is the display's white.
    pub panorama: Panorama,
    /// Share of the sphere that is clipped in at least one channel, 0 to 1.
    pub clipped: f64,
    /// Number of regions that are clipped in all channels.
    pub regions: usize,
    /// The disc that was added, if any.
    pub sun: Option<Sun>,
}

/// A light source rebuilt from a clipped region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector to its centre.
    pub direction: [f32; 3],
    /// ∫ L dω of the disc, luminance in units of white · steradian.
    pub energy: f64,
}

/// Radiance from display values.
pub trait Expand {
    /// By the rules of the [module](self). Without clipped pixels this is [`LdrPanorama::linear`].
    #[must_use]
    fn expand(&self, options: &ExpandOptions) -> Expanded;

    /// With what is clipped estimated by a network; see [`network`]. Without clipped pixels this is
    /// [`LdrPanorama::linear`].
    ///
    /// # Errors
    /// Those of the network; [`Error::Invalid`](crate::Error::Invalid) if it is made for another size than the options
    /// name, or gives values that are not a radiance.
    fn expand_by(
        &self,
        network: &dyn network::ExpansionNetwork,
        options: &network::NetworkOptions,
    ) -> Result<network::NetworkExpanded>;
}

impl Expand for LdrPanorama {
    fn expand(&self, options: &ExpandOptions) -> Expanded {
        let analysis = Analysis::new(self, options.transfer);
        let (panorama, sun) = rebuild::rebuild(&analysis, &options.parameters);
        Expanded { panorama, clipped: analysis.clipped(), regions: analysis.regions().len(), sun }
    }

    fn expand_by(
        &self,
        network: &dyn network::ExpansionNetwork,
        options: &network::NetworkOptions,
    ) -> Result<network::NetworkExpanded> {
        network::expand_by(self, network, options)
    }
}
