//! The models inside this library (features `pretrained` and `pretrained-large`).

use super::Model;

/// A model's latent dimension, and its file.
const FILES: &[(usize, &[u8])] = &[
    (27, include_bytes!("../../assets/veni-27.safetensors")),
    #[cfg(feature = "pretrained-large")]
    (147, veni_models_147::FILE),
    #[cfg(feature = "pretrained-large")]
    (300, veni_models_300::FILE),
];

/// Models of earlier versions, without their encoders, by their hash: for the latents that name them.
const EARLIER: &[(&str, &[u8])] =
    &[("25f38109d2d49697", include_bytes!("../../assets/veni-27-first.safetensors"))];

impl Model {
    /// The smallest model inside this library: 9 latent vectors (latent dimension D = 27), trained on outdoor
    /// panoramas, with its encoder.
    ///
    /// # Panics
    /// Never in a released build: a test decodes every embedded file.
    #[allow(clippy::expect_used, reason = "the bytes are part of the program and tested with it")]
    pub fn pretrained() -> Self {
        Self::from_bytes(FILES[0].1).expect("embedded model")
    }

    /// The model inside this library of latent dimension D (three per latent vector), if there is one: see
    /// [`Model::pretrained_sizes`].
    ///
    /// # Panics
    /// As [`Model::pretrained`].
    #[allow(clippy::expect_used, reason = "the bytes are part of the program and tested with it")]
    pub fn pretrained_of(dimension: usize) -> Option<Self> {
        let (_, bytes) = FILES.iter().find(|(own, _)| *own == dimension)?;
        Some(Self::from_bytes(bytes).expect("embedded model"))
    }

    /// The model inside this library that has this [hash](Model::hash), which a latent names it by, if there is one. Of a model
    /// that an earlier version had inside it has no encoder: what it made can be decoded, not made again.
    ///
    /// # Panics
    /// As [`Model::pretrained`].
    #[allow(clippy::expect_used, reason = "the bytes are part of the program and tested with it")]
    pub fn pretrained_of_hash(hash: &str) -> Option<Self> {
        let earlier = EARLIER.iter().find(|(own, _)| *own == hash);
        if let Some((_, bytes)) = earlier {
            return Some(Self::from_bytes(bytes).expect("embedded model"));
        }
        Self::pretrained_sizes().filter_map(Self::pretrained_of).find(|model| model.hash() == hash)
    }

    /// The latent dimensions of the models inside this library: 27, and with `pretrained-large` 147 and 300.
    pub fn pretrained_sizes() -> impl Iterator<Item = usize> {
        FILES.iter().map(|(dimension, _)| *dimension)
    }
}
