//! What renderers need of an environment map: its lights, its harmonics, samples of it, prefiltered maps.
//!
//! Radiance is linear Rec. 709 in the units of the map; directions are of the [native frame](crate::sphere).

mod compact;
mod environment;
mod prefilter;
mod quadrature;
mod reduce;
mod spectrum;

pub use compact::{CompactLight, Kind, RadiusSource};
pub use environment::EnvironmentMap;
pub use prefilter::{CubeAxes, CubeMap, Dfg, Law, Levels, Prefilter};
pub use spectrum::{MAX_DEGREE, Spectrum};
