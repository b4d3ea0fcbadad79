//! A model's two ways: its encoder, and a latent optimised for each image.

use serde_json::{Value, json};

use super::Codec;
use crate::fitting::FitSettings;
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_light::latent::Latent;
use veni_light::sphere::Equirect;

/// Where the optimisation of a latent starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Start {
    /// The mean of the encoder's posterior.
    Encoder,
    /// All vectors zero.
    Zero,
}

/// The auto-encoder pass: the mean of the encoder's posterior.
#[derive(Clone, Copy, Debug)]
pub struct Autoencoder<'a> {
    subject: &'a LoadedModel,
}

impl<'a> Autoencoder<'a> {
    /// The pass of a model, if it has an encoder.
    pub fn new(subject: &'a LoadedModel) -> Option<Self> {
        subject.veni().map(|_| Self { subject })
    }
}

/// A latent optimised for each image under the fixed decoder, as the fit leaves it. The loss is none of the scores that
/// the tables report, so a score may fall where the loss falls.
#[derive(Clone, Copy, Debug)]
pub struct Optimised<'a> {
    subject: &'a LoadedModel,
    settings: FitSettings,
    start: Start,
}

impl<'a> Optimised<'a> {
    /// From the encoder's latent, or from 0 where there is no encoder.
    pub fn new(subject: &'a LoadedModel, settings: FitSettings) -> Self {
        let start = if subject.veni().is_some() { Start::Encoder } else { Start::Zero };
        Self { subject, settings, start }
    }
}

impl Codec for Autoencoder<'_> {
    fn system(&self) -> &str {
        self.subject.name()
    }

    fn pass(&self) -> &str {
        "autoencoder"
    }

    fn dimension(&self) -> usize {
        self.subject.dimension()
    }

    fn key(&self) -> Value {
        json!({ "model": self.subject.identity(), "pass": "autoencoder" })
    }

    fn encode(&self, grid: Equirect, image: &[f32]) -> Result<Vec<f32>> {
        Ok(numbers(self.subject.encode(grid, &[image])?))
    }

    fn decode(&self, grid: Equirect, code: &[f32]) -> Result<Vec<f32>> {
        Ok(self.subject.decode(grid, &[latent(code)])?.concat())
    }
}

impl Codec for Optimised<'_> {
    fn system(&self) -> &str {
        self.subject.name()
    }

    fn pass(&self) -> &str {
        "optimised"
    }

    fn dimension(&self) -> usize {
        self.subject.dimension()
    }

    fn key(&self) -> Value {
        let start = match self.start {
            Start::Encoder => "encoder",
            Start::Zero => "zero",
        };
        json!({
            "model": self.subject.identity(),
            "pass": "optimised",
            "start": start,
            "fit": self.settings.key(),
        })
    }

    fn encode(&self, grid: Equirect, image: &[f32]) -> Result<Vec<f32>> {
        let start = match self.start {
            Start::Encoder => self.subject.encode(grid, &[image])?,
            Start::Zero => vec![Latent::new(vec![[0.0; 3]; self.subject.latent_vectors()])],
        };
        let fitted = self.settings.fit(self.subject, grid, &[image], &start);
        Ok(numbers(fitted.map_err(|e| Error::invalid(format!("{}: {e}", self.subject.name())))?.latents))
    }

    fn decode(&self, grid: Equirect, code: &[f32]) -> Result<Vec<f32>> {
        Ok(self.subject.decode(grid, &[latent(code)])?.concat())
    }
}

/// The coordinates of a single latent.
fn numbers(latents: Vec<Latent>) -> Vec<f32> {
    latents.into_iter().flat_map(|z| z.vectors).flatten().collect()
}

/// A code's numbers as a latent.
pub(crate) fn latent(code: &[f32]) -> Latent {
    Latent::new(code.as_chunks().0.to_vec())
}
