//! The classical bases: spherical harmonics and spherical Gaussians of the same dimension D.

use serde_json::json;

use super::Codec;
use crate::baseline::gaussians::Search;
use crate::baseline::{Baseline, BaselineKind, Fitted, TargetSpace};
use crate::canonical::Canonical;
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// A basis fitted to each image.
#[derive(Clone, Debug)]
pub struct FittedBasis {
    system: Baseline,
    name: String,
}

impl FittedBasis {
    /// The largest system of this kind, in log radiance, of at most `dimension` coefficients; `quick`: lobes are searched by
    /// [`Search::quick`].
    ///
    /// # Errors
    /// As [`Baseline::from_dimension`].
    pub fn new(kind: BaselineKind, dimension: usize, quick: bool) -> Result<Self> {
        let system = Baseline::from_dimension(kind, dimension, TargetSpace::Log)?;
        let system = if quick { system.searched(Search::quick()) } else { system };
        let name = match kind {
            BaselineKind::SphericalHarmonics => "SH",
            BaselineKind::SphericalGaussians => "SG",
            BaselineKind::GaussianMixture => "SG mixture",
        };
        Ok(Self { name: format!("{name} {}", system.dimension()), system })
    }
}

impl Codec for FittedBasis {
    fn system(&self) -> &str {
        &self.name
    }

    fn pass(&self) -> &str {
        match self.system {
            Baseline::SphericalHarmonics { .. } => "least squares",
            Baseline::SphericalGaussians { .. } | Baseline::GaussianMixture { .. } => "optimised",
        }
    }

    fn dimension(&self) -> usize {
        self.system.dimension()
    }

    fn key(&self) -> Canonical {
        // sizes, space and search
        Canonical::of(json!({ "baseline": format!("{:?}", self.system) }))
    }

    fn encode(&self, grid: Equirect, image: &[f32]) -> Result<Vec<f32>> {
        let fitted = self.system.fit(grid, image).map_err(|e| self.named(&e))?;
        Ok(fitted.parameters().into_iter().map(|v| v as f32).collect())
    }

    fn decode(&self, grid: Equirect, code: &[f32]) -> Result<Vec<f32>> {
        let parameters: Vec<_> = code.iter().map(|v| f64::from(*v)).collect();
        let fitted = Fitted::from_parameters(&self.system, &parameters).map_err(|e| self.named(&e))?;
        Ok(fitted.log_radiance(&grid.directions()).into_flattened())
    }
}

impl FittedBasis {
    fn named(&self, error: &Error) -> Error {
        Error::invalid(format!("{}: {error}", self.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_as_long_as_it_says_and_gives_the_image_back() {
        let grid = Equirect::new(16, 8);
        let sky: Vec<f32> = grid.directions().iter().flat_map(|d| [d[2], 0.5 * d[0], 1.0]).collect();
        for kind in [
            BaselineKind::SphericalHarmonics,
            BaselineKind::SphericalGaussians,
            BaselineKind::GaussianMixture,
        ] {
            let basis = FittedBasis::new(kind, 27, false).unwrap();
            let code = basis.encode(grid, &sky).unwrap();
            assert_eq!((code.len(), basis.dimension()), (27, 27), "{kind:?}");
            let image = basis.decode(grid, &code).unwrap();
            let worst = image.iter().zip(&sky).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 0.3, "{kind:?}: {worst}");
        }
        assert_ne!(
            FittedBasis::new(BaselineKind::SphericalHarmonics, 27, false).unwrap().key(),
            FittedBasis::new(BaselineKind::SphericalHarmonics, 147, false).unwrap().key()
        );
        // what is kept of a quick search is not taken for the whole one's
        let key = |quick| FittedBasis::new(BaselineKind::SphericalGaussians, 27, quick).unwrap().key();
        assert_ne!(key(true), key(false));
    }
}
