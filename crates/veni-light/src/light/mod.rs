//! What renderers need of an environment map: its lights, its harmonics, samples of it, prefiltered maps.
//!
//! Radiance is linear Rec. 709 in the units of the map; directions are of the [native frame](crate::sphere). Equations and the
//! conventions of engines are in docs/LIGHT.md and docs/LIGHT-ENGINES.md.
//!
//! | here | what |
//! |---|---|
//! | [`EnvironmentMap`] | radiance of all directions, borrowed |
//! | [`Light`], [`LightOptions`] | a map split into compact lights, the sun first, and the rest |
//! | [`CompactLight`], [`Lights`], [`Disc`], [`Profile`] | one light, those of a scene, a light's exact place on pixels, its radiance as plain numbers |
//! | [`sh`] | spherical harmonics |
//! | [`Spectrum`] | harmonics up to degrees in the hundreds |
//! | [`Prefilter`], [`CubeMap`], [`Dfg`] | prefiltered maps, and the table that goes with them |
//! | [`Sampler`], [`SplitSampler`] | directions drawn by how much light comes from them |
//! | [`lobe_gains`], [`gauss_legendre`] | for spectra elsewhere: what a level makes of each degree, and a quadrature over latitudes |

mod angle;
mod environment;
mod extract;
mod lit;
#[cfg(feature = "prefilter")]
mod prefilter;
mod quadrature;
mod reduce;
mod rotate;
mod sampler;
pub mod sh;
#[cfg(feature = "prefilter")]
mod spectrum;

pub use crate::compact::{CompactLight, Disc, Falloff, Kind, Lights, Profile, RadiusSource};
pub use crate::luminance::{LUMINANCE, luminance};
pub use environment::EnvironmentMap;
pub use extract::SunChoice;
pub use lit::{Light, LightOptions};
#[cfg(feature = "prefilter")]
pub use prefilter::{CubeAxes, CubeMap, Dfg, Law, Levels, Prefilter, lobe_gains};
pub use quadrature::gauss_legendre;
pub use sampler::{Sample, Sampler, SplitSampler};
pub use sh::Sh;
#[cfg(feature = "prefilter")]
pub use spectrum::{MAX_DEGREE, Spectrum};

#[cfg(test)]
mod tests;
