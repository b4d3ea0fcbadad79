//! The models inside this library (features `pretrained` and `pretrained-large`).

use super::Model;

/// A model's size in numbers, and its file.
const FILES: &[(usize, &[u8])] = &[
    (27, include_bytes!("../../assets/veni-27.safetensors")),
    #[cfg(feature = "pretrained-large")]
    (147, veni_models_147::FILE),
    #[cfg(feature = "pretrained-large")]
    (300, veni_models_300::FILE),
];

impl Model {
    /// The smallest model inside this library: 9 latent vectors (27 numbers), trained on outdoor panoramas, with its
    /// encoder.
    ///
    /// # Panics
    /// Never in a released build: a test decodes every embedded file.
    #[allow(clippy::expect_used, reason = "the bytes are part of the program and tested with it")]
    pub fn pretrained() -> Self {
        Self::from_bytes(FILES[0].1).expect("embedded model")
    }

    /// The model inside this library whose latents are so many numbers (three per latent vector), if there is one: see
    /// [`Model::pretrained_sizes`].
    ///
    /// # Panics
    /// As [`Model::pretrained`].
    #[allow(clippy::expect_used, reason = "the bytes are part of the program and tested with it")]
    pub fn pretrained_of(dimension: usize) -> Option<Self> {
        let (_, bytes) = FILES.iter().find(|(size, _)| *size == dimension)?;
        Some(Self::from_bytes(bytes).expect("embedded model"))
    }

    /// The sizes of the models inside this library, in numbers: 27, and with `pretrained-large` 147 and 300.
    pub fn pretrained_sizes() -> impl Iterator<Item = usize> {
        FILES.iter().map(|(size, _)| *size)
    }
}
