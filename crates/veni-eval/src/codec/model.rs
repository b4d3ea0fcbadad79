//! A model's two ways: its encoder, and a latent optimised for each image.

use serde_json::json;

use super::Codec;
use crate::canonical::Canonical;
use crate::fitting::FitSettings;
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_light::latent::Latent;
use veni_light::light::{CompactLight, Lights};
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
        self.subject.dimension() + LIGHT * self.subject.lights()
    }

    fn key(&self) -> Canonical {
        exposed(self.subject, json!({ "model": self.subject.identity(), "pass": "autoencoder" }))
    }

    fn encode(&self, grid: Equirect, image: &[f32]) -> Result<Vec<f32>> {
        Ok(coordinates(&self.subject.encode(grid, &[image])?))
    }

    fn decode(&self, grid: Equirect, code: &[f32]) -> Result<Vec<f32>> {
        Ok(self.subject.decode(grid, &[latent(self.subject, code)])?.concat())
    }

    fn lights(&self, code: &[f32]) -> Option<Lights> {
        named(self.subject, &latent(self.subject, code))
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
        self.subject.dimension() + LIGHT * self.subject.lights()
    }

    fn key(&self) -> Canonical {
        let start = match self.start {
            Start::Encoder => "encoder",
            Start::Zero => "zero",
        };
        exposed(
            self.subject,
            json!({
                "model": self.subject.identity(),
                "pass": "optimised",
                "start": start,
                "fit": self.settings.key(),
            }),
        )
    }

    fn encode(&self, grid: Equirect, image: &[f32]) -> Result<Vec<f32>> {
        let rest = self.subject.without_lights(grid, image)?;
        let vectors = match self.start {
            Start::Encoder => self.subject.encode_rest(grid, &[&*rest.log_radiance])?.remove(0),
            Start::Zero => vec![[0.0; 3]; self.subject.latent_vectors()],
        };
        let fitted = self.settings.fit(self.subject, grid, &[&*rest.log_radiance], &[Latent::new(vectors)]);
        let mut fitted = fitted.map_err(|e| Error::invalid(format!("{}: {e}", self.subject.name())))?.latents;
        self.subject.expose(grid, &rest, &mut fitted)?;
        // the fit may have moved the exposure of the rest, which the lights do not share
        let whole = |z: Latent| Latent {
            lights: rest.code.lights.scaled((-z.log_exposure).exp()),
            log_exposure: z.log_exposure + rest.code.log_exposure,
            ..z
        };
        Ok(coordinates(&fitted.into_iter().map(whole).collect::<Vec<_>>()))
    }

    fn decode(&self, grid: Equirect, code: &[f32]) -> Result<Vec<f32>> {
        Ok(self.subject.decode(grid, &[latent(self.subject, code)])?.concat())
    }

    fn lights(&self, code: &[f32]) -> Option<Lights> {
        named(self.subject, &latent(self.subject, code))
    }
}

/// The lights of a latent, exposure included, if codes of the model have any.
pub(super) fn named(subject: &LoadedModel, latent: &Latent) -> Option<Lights> {
    (subject.lights() > 0).then(|| latent.lights.scaled(latent.log_exposure.exp()))
}

/// The key of a pass: codes with lights were at another exposure before, and are kept under that key.
pub(super) fn exposed(subject: &LoadedModel, mut key: serde_json::Value) -> Canonical {
    if subject.lights() > 0 {
        key["exposure"] = json!("surfaces");
    }
    // as many as the model was trained without, once the only number, are kept without it
    if subject.lights() != subject.model().config().lights {
        key["lights"] = json!(subject.lights());
    }
    Canonical::of(key)
}

/// The parameters of a light.
pub(super) const LIGHT: usize = 7;

/// The coordinates of a single latent; then, of one with lights, the rest of [`code`].
fn coordinates(latents: &[Latent]) -> Vec<f32> {
    let of = |z: &Latent| if z.lights.is_empty() { z.vectors.concat() } else { code(z) };
    latents.iter().flat_map(of).collect()
}

/// The coordinates of a latent, its log exposure, whether the first light is the sun, and seven parameters of each light.
pub(crate) fn code(z: &Latent) -> Vec<f32> {
    let mut all = z.vectors.concat();
    all.extend([z.log_exposure, f32::from(u8::from(z.lights.sun().is_some()))]);
    for CompactLight { direction, irradiance, radius, .. } in z.lights.iter() {
        all.extend(direction.iter().chain(irradiance).chain([radius]));
    }
    all
}

/// A code's coordinates as a latent of the model.
pub(crate) fn latent(subject: &LoadedModel, code: &[f32]) -> Latent {
    let (vectors, lights) = code.split_at(3 * subject.latent_vectors());
    let light = |n: &[f32; LIGHT]| CompactLight::new([n[0], n[1], n[2]], [n[3], n[4], n[5]], n[6]);
    let plain = Latent::new(vectors.as_chunks().0.to_vec());
    let [log_exposure, sun, lights @ ..] = lights else { return plain };
    let mut lights = lights.as_chunks().0.iter().map(light);
    let sun = if *sun > 0.0 { lights.next() } else { None };
    Latent { lights: Lights::new(sun, lights), log_exposure: *log_exposure, ..plain }
}
