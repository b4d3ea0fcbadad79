//! Which system, of which size.

use super::fitted::{BaselineField, Fitted};
use super::gaussians::{Gaussians, Search};
use super::harmonics::Harmonics;
use super::target::{Target, TargetSpace};
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// A family of systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BaselineKind {
    /// [`Baseline::SphericalHarmonics`].
    SphericalHarmonics,
    /// [`Baseline::SphericalGaussians`].
    SphericalGaussians,
    /// [`Baseline::GaussianMixture`].
    GaussianMixture,
}

/// A system to compare with; see the [module](super).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Baseline {
    /// Real spherical harmonics up to order L: 3(L+1)² coefficients. Solved in closed form.
    SphericalHarmonics {
        /// L.
        order: usize,
        /// What is expanded.
        space: TargetSpace,
    },
    /// f = b + Σ_g a_g e^{λ_g(⟨μ_g,d⟩−1)}, a of either sign: 6 coefficients per lobe and 3 for b.
    SphericalGaussians {
        /// K.
        lobes: usize,
        /// What is expanded.
        space: TargetSpace,
        /// How the lobes are searched.
        search: Search,
    },
    /// L = b + Σ_g a_g e^{λ_g(⟨μ_g,d⟩−1)} with a, b > 0, and the squared error of ln L least: 6 coefficients per lobe and 3
    /// for b.
    GaussianMixture {
        /// K.
        lobes: usize,
        /// How the lobes are searched.
        search: Search,
    },
}

impl Baseline {
    /// The largest system of this kind of at most `dimension` coefficients: harmonics of order ⌊√(D/3)⌋ − 1,
    /// or ⌊(D−3)/6⌋ lobes and a constant. D = 27, 147, 300 give L = 2, 6, 9 (27, 147, 300 coefficients) and
    /// K = 4, 24, 49 (27, 147, 297). A mixture expands radiance by definition; `space` is for the others.
    ///
    /// # Errors
    /// [`Error::Invalid`] if not even a constant fits into `dimension`.
    pub fn from_dimension(kind: BaselineKind, dimension: usize, space: TargetSpace) -> Result<Self> {
        if dimension < 3 {
            return Err(Error::invalid(format!(
                "a baseline of dimension {dimension}: a constant colour already takes 3"
            )));
        }
        let (lobes, search) = ((dimension - 3) / 6, Search::default());
        Ok(match kind {
            BaselineKind::SphericalHarmonics => {
                Self::SphericalHarmonics { order: (dimension / 3).isqrt() - 1, space }
            }
            BaselineKind::SphericalGaussians => Self::SphericalGaussians { lobes, space, search },
            BaselineKind::GaussianMixture => Self::GaussianMixture { lobes, search },
        })
    }

    /// With this search for its lobes, if it has any.
    #[must_use]
    pub fn searched(mut self, by: Search) -> Self {
        match &mut self {
            Self::SphericalHarmonics { .. } => {}
            Self::SphericalGaussians { search, .. } | Self::GaussianMixture { search, .. } => *search = by,
        }
        self
    }

    /// Numbers that a fit of this system consists of.
    pub fn dimension(&self) -> usize {
        match *self {
            Self::SphericalHarmonics { order, .. } => 3 * (order + 1) * (order + 1),
            Self::SphericalGaussians { lobes, .. } | Self::GaussianMixture { lobes, .. } => 6 * lobes + 3,
        }
    }

    /// The quantity that a fit of this system is an expansion of.
    pub fn space(&self) -> TargetSpace {
        match *self {
            Self::SphericalHarmonics { space, .. } | Self::SphericalGaussians { space, .. } => space,
            Self::GaussianMixture { .. } => TargetSpace::Linear,
        }
    }

    /// Fits the system to an image of natural-log radiance, `[height, width, 3]` on the pixel centres of `grid`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the image does not have 3·W·H values, has one that is not a logarithm of an f32, or has
    /// too few pixels for the system; or if the search has no start or a rate outside (0, 1].
    pub fn fit(&self, grid: Equirect, log_radiance: &[f32]) -> Result<Fitted> {
        let target = |space| Target::new(grid, log_radiance, space);
        let field = match self {
            Self::SphericalHarmonics { order, space } => {
                BaselineField::Harmonics(Harmonics::fit(*order, &target(*space)?)?)
            }
            Self::SphericalGaussians { lobes, space, search } => {
                BaselineField::Gaussians(Gaussians::fit(*lobes, &target(*space)?, search)?)
            }
            Self::GaussianMixture { lobes, search } => {
                BaselineField::Gaussians(Gaussians::fit_mixture(*lobes, &target(TargetSpace::Log)?, search)?)
            }
        };
        Ok(Fitted { space: self.space(), field })
    }
}
