//! Ways to code a panorama at latent dimension D and to get it back: what reconstruction compares.
//!
//! Every row of a reconstruction table is a [`Codec`]. A model's two passes are one each, a classical basis is
//! one.

mod basis;
mod lobes;
pub(crate) mod model;

pub use basis::FittedBasis;
pub use lobes::Lobed;
pub use model::{Autoencoder, Optimised};

use crate::Result;
use crate::canonical::Canonical;
use veni_light::light::Lights;
use veni_light::sphere::Equirect;

/// A way to code a panorama at latent dimension D and to get it back.
pub trait Codec: Sync {
    /// The system, the row's name in tables.
    fn system(&self) -> &str;

    /// Which of the system's ways this is ("autoencoder", "optimised", "least squares").
    fn pass(&self) -> &str;

    /// The latent dimension D.
    fn dimension(&self) -> usize;

    /// Everything that decides a code besides the image: part of the key under which codes are kept.
    fn key(&self) -> Canonical;

    /// The code, D values, for an image of log radiance at exposure 0 (3·W·H values). They depend on nothing else, so
    /// that what is kept of one image stays true whatever it was coded beside.
    ///
    /// # Errors
    /// What the system says, naming itself.
    fn encode(&self, grid: Equirect, image: &[f32]) -> Result<Vec<f32>>;

    /// Log radiance at exposure 0 for a code.
    ///
    /// # Errors
    /// What the system says, naming itself.
    fn decode(&self, grid: Equirect, code: &[f32]) -> Result<Vec<f32>>;

    /// The compact lights that a code names, in units of what it decodes to. None: this system's codes name none.
    fn lights(&self, _code: &[f32]) -> Option<Lights> {
        None
    }
}
