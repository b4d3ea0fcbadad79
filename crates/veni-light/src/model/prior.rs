//! The prior's tensors in a model file.
//!
//! `prior.xy_real`, `prior.xy_imaginary`, `prior.z` [N, N]: lower triangles of the covariances' Cholesky factors;
//! `prior.z_mean` [N]; `prior.log_exposure` [2]: mean and standard deviation.

use std::collections::BTreeMap;

use super::{Array, Model};
use crate::latent::Prior;
use crate::{Error, Result};

const NAMES: [&str; 5] =
    ["prior.xy_real", "prior.xy_imaginary", "prior.z", "prior.z_mean", "prior.log_exposure"];

fn shapes(n: usize) -> [Vec<usize>; 5] {
    [vec![n, n], vec![n, n], vec![n, n], vec![n], vec![2]]
}

/// None of the prior's tensors, or exactly all of them.
pub(super) fn check(tensors: &BTreeMap<String, Array>, n: usize) -> Result<()> {
    let stray = |name: &&String| name.starts_with("prior.") && !NAMES.contains(&name.as_str());
    if let Some(name) = tensors.keys().find(stray) {
        return Err(Error::invalid(format!("tensor {name} is unexpected in a prior")));
    }
    if !NAMES.iter().any(|name| tensors.contains_key(*name)) {
        return Ok(());
    }
    for (name, shape) in NAMES.iter().zip(shapes(n)) {
        match tensors.get(*name) {
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

impl Model {
    /// The Gaussian fitted to the training latents; the standard normal if the file has none.
    pub fn prior(&self) -> Prior {
        let tensor = |name: &str| self.tensors.get(name).map(|tensor| tensor.data.clone());
        let [xy_real, xy_imaginary, z, z_mean, exposure] = NAMES.map(tensor);
        match (xy_real, xy_imaginary, z, z_mean, exposure.as_deref()) {
            (Some(xy_real), Some(xy_imaginary), Some(z), Some(z_mean), Some(&[mean, deviation])) => {
                Prior { xy_real, xy_imaginary, z, z_mean, log_exposure: [mean, deviation] }
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
        let Prior { xy_real, xy_imaginary, z, z_mean, log_exposure } = prior.clone();
        let parts = [xy_real, xy_imaginary, z, z_mean, log_exposure.to_vec()];
        for ((name, shape), data) in NAMES.iter().zip(shapes(n)).zip(parts) {
            self.tensors.insert((*name).to_owned(), Array { shape, data });
        }
        Ok(())
    }
}
