//! The prior's tensors in a model file.
//!
//! `prior.xy_real`, `prior.xy_imaginary`, `prior.z` [N, N]: lower triangles of the covariances' Cholesky factors;
//! `prior.z_mean` [N]; `prior.log_exposure` [2]: mean and standard deviation. Beside them, where suns were known, `prior.sun.*`: the
//! sun conditioned on the vectors ([`SunPrior`]).

use std::collections::BTreeMap;

use super::prior_sun::{of_tensors, schema as sun_schema, to_tensors};
use super::{Array, Model};
use crate::latent::Prior;
use crate::{Error, Result};

const NAMES: [&str; 5] =
    ["prior.xy_real", "prior.xy_imaginary", "prior.z", "prior.z_mean", "prior.log_exposure"];

fn shapes(n: usize) -> [Vec<usize>; 5] {
    [vec![n, n], vec![n, n], vec![n, n], vec![n], vec![2]]
}

/// None of the prior's tensors, or exactly all of them; of the sun's none or all, and none without the others.
pub(super) fn check(tensors: &BTreeMap<String, Array>, n: usize) -> Result<()> {
    let (base, sun) = (NAMES.iter().copied().zip(shapes(n)), sun_schema(n));
    let mut known: Vec<_> = base.collect();
    let stray = |name: &&String| {
        let listed = known.iter().chain(&sun).any(|(known, _)| known == name);
        name.starts_with("prior.") && !listed
    };
    if let Some(name) = tensors.keys().find(stray) {
        return Err(Error::invalid(format!("tensor {name} is unexpected in a prior")));
    }
    if has_sun(tensors) {
        known.extend(sun);
    }
    if !known.iter().any(|(name, _)| tensors.contains_key(*name)) {
        return Ok(());
    }
    for (name, shape) in known {
        match tensors.get(name) {
            None => return Err(Error::invalid(format!("tensor {name} {shape:?} is missing from the prior"))),
            Some(tensor) if tensor.shape != shape => {
                let found = &tensor.shape;
                return Err(Error::invalid(format!(
                    "tensor {name} is {found:?}, a prior of this model has {shape:?}"
                )));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

/// Whether any of the sun's tensors is there.
pub(super) fn has_sun(tensors: &BTreeMap<String, Array>) -> bool {
    tensors.keys().any(|name| name.starts_with("prior.sun."))
}

impl Model {
    /// The Gaussian fitted to the training latents; the standard normal if the file has none.
    pub fn prior(&self) -> Prior {
        let tensor = |name: &str| self.tensors.get(name).map(|tensor| tensor.data.clone());
        let [xy_real, xy_imaginary, z, z_mean, exposure] = NAMES.map(tensor);
        match (xy_real, xy_imaginary, z, z_mean, exposure.as_deref()) {
            (Some(xy_real), Some(xy_imaginary), Some(z), Some(z_mean), Some(&[mean, deviation])) => {
                let sun = of_tensors(&self.tensors, self.latent_vectors());
                Prior { xy_real, xy_imaginary, z, z_mean, log_exposure: [mean, deviation], sun }
            }
            _ => Prior::standard(self.latent_vectors()),
        }
    }

    /// Whether a fitted prior is stored.
    pub fn has_prior(&self) -> bool {
        self.tensors.contains_key(NAMES[0])
    }

    /// Stores a fitted prior in place of the previous one.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is for another number of latent vectors.
    pub fn set_prior(&mut self, prior: &Prior) -> Result<()> {
        let (n, m) = (self.latent_vectors(), prior.latent_vectors());
        if n != m {
            return Err(Error::invalid(format!("a prior of {m} vectors does not fit a model of {n}")));
        }
        let Prior { xy_real, xy_imaginary, z, z_mean, log_exposure, sun } = prior.clone();
        let parts = [xy_real, xy_imaginary, z, z_mean, log_exposure.to_vec()];
        for ((name, shape), data) in NAMES.iter().zip(shapes(n)).zip(parts) {
            self.tensors.insert((*name).to_owned(), Array { shape, data });
        }
        self.tensors.retain(|name, _| !name.starts_with("prior.sun."));
        let sun = sun.iter().flat_map(to_tensors);
        self.tensors.extend(sun.map(|(name, array)| (name.to_owned(), array)));
        Ok(())
    }
}
