//! The density of the sun as the tensors of a model file: `prior.sun.*`.

use std::collections::BTreeMap;

use super::Array;
use crate::latent::{MEASURES, SunPrior};

/// Names and shapes for N vectors.
pub(super) fn schema(n: usize) -> [(&'static str, Vec<usize>); 6] {
    [
        ("prior.sun.azimuth", vec![n, 2]),
        ("prior.sun.azimuth_noise", vec![1]),
        ("prior.sun.measures", vec![MEASURES, n]),
        ("prior.sun.mean", vec![MEASURES]),
        ("prior.sun.noise", vec![MEASURES, MEASURES]),
        ("prior.sun.presence", vec![n + 1]),
    ]
}

/// In the order of [`schema`].
pub(super) fn to_tensors(sun: &SunPrior) -> Vec<(&'static str, Array)> {
    let data = [
        sun.azimuth.as_flattened().to_vec(),
        vec![sun.azimuth_noise],
        sun.weights.clone(),
        sun.mean.to_vec(),
        sun.noise.as_flattened().to_vec(),
        sun.presence.clone(),
    ];
    let named = schema(sun.latent_vectors()).into_iter().zip(data);
    named.map(|((name, shape), data)| (name, Array { shape, data })).collect()
}

/// None where there is none. Shapes are checked before.
pub(super) fn of_tensors(tensors: &BTreeMap<String, Array>, n: usize) -> Option<SunPrior> {
    let [azimuth, azimuth_noise, measures, mean, noise, presence] =
        schema(n).map(|(name, _)| tensors.get(name).map(|tensor| tensor.data.as_slice()));
    Some(SunPrior {
        azimuth: azimuth?.as_chunks().0.to_vec(),
        azimuth_noise: *azimuth_noise?.first()?,
        weights: measures?.to_vec(),
        mean: mean?.try_into().ok()?,
        noise: noise?.as_chunks().0.try_into().ok()?,
        presence: presence?.to_vec(),
    })
}
