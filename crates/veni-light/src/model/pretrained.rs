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

    /// The latent dimensions of the models inside this library: 27, and with `pretrained-large` 147 and 300.
    pub fn pretrained_sizes() -> impl Iterator<Item = usize> {
        FILES.iter().map(|(dimension, _)| *dimension)
    }
}
