//! The model that a picture's latent is fitted to: its decoder in whichever form it runs, and its encoder.

use anyhow::Result;
#[cfg(feature = "learn")]
use veni_core::fit::best_of;
#[cfg(not(feature = "learn"))]
use veni_fit::best_of;
use veni_fit::{Best, Encoder, FitConfig, FitTarget, LatentDecoder, Observation};
use veni_image::metrics::{Alignment, Scores, scores};
use veni_light::latent::{Latent, Prior};
use veni_light::model::Model;
use veni_light::sphere::Equirect;

use crate::source::Loaded;

/// A model, ready for fits.
pub(super) struct FitModel {
    name: String,
    model: Model,
    lobes: usize,
    encoder: Option<Encoder>,
    decoder: Decoder,
}

/// The decoder folded per latent; where its network does not fold, as a graph of tensors.
enum Decoder {
    Folded(veni_light::field::Decoder),
    #[cfg(feature = "learn")]
    Graph(Box<veni_core::vae::Decoder>),
}

impl FitModel {
    pub(super) fn new(loaded: Loaded) -> Result<Self> {
        let Loaded { model, name, lobes } = loaded;
        let decoder = decoder(&model).map_err(|e| e.in_file(&name))?;
        let encoder = match model.has_encoder() {
            true => Some(Encoder::new(&model).map_err(|e| e.in_file(&name))?),
            false => None,
        };
        Ok(Self { name, model, lobes, encoder, decoder })
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn hash(&self) -> String {
        self.model.hash()
    }

    pub(super) fn prior(&self) -> Prior {
        self.model.prior()
    }

    /// The most lights that are measured in a panorama, unless somebody says otherwise.
    pub(super) fn lights(&self) -> usize {
        self.model.config().measured_lights()
    }

    /// The lobes of a picture's code, unless another number is asked for.
    pub(super) fn lobes(&self) -> usize {
        self.lobes
    }

    pub(super) fn latent_vectors(&self) -> usize {
        self.model.latent_vectors()
    }

    /// The mean of the encoder's posterior for log radiance at exposure 0; `None` without an encoder.
    pub(super) fn encode(&self, grid: Equirect, log_radiance: &[f32]) -> Result<Option<Latent>> {
        let Some(encoder) = &self.encoder else { return Ok(None) };
        let encoded = encoder.encode(grid, &[log_radiance]).map_err(|e| e.in_file(&self.name))?;
        Ok(encoded.into_iter().next().map(|encoded| Latent::new(encoded.vectors)))
    }

    pub(super) fn has_encoder(&self) -> bool {
        self.encoder.is_some()
    }

    pub(super) fn decoder(&self) -> &dyn LatentDecoder {
        match &self.decoder {
            Decoder::Folded(decoder) => decoder,
            #[cfg(feature = "learn")]
            Decoder::Graph(decoder) => decoder.as_ref(),
        }
    }

    /// Log radiance at the latent's exposure on every pixel, lights included, 3·W·H values.
    pub(super) fn decode(&self, grid: Equirect, latent: &Latent) -> Result<Vec<f32>> {
        let decoded = self.decoder().in_directions(grid.directions()).forward(std::slice::from_ref(latent));
        let decoded = decoded.map_err(|e| e.in_file(&self.name))?;
        let log: Vec<f32> = decoded.into_iter().map(|v| v as f32).collect();
        if latent.lights.is_empty() {
            return Ok(log);
        }
        let mut radiance: Vec<_> = log.as_chunks::<3>().0.iter().map(|p| p.map(f32::exp)).collect();
        latent.lights.scaled(latent.log_exposure.exp()).add_to_rows(grid, 0..grid.height, &mut radiance);
        Ok(radiance.into_flattened().into_iter().map(f32::ln).collect())
    }

    /// The paper's protocol, on the pixels that were fitted.
    pub(super) fn score(&self, latent: &Latent, seen: &Observation) -> Result<Scores> {
        let Equirect { width, height } = seen.grid();
        let decoded = self.decode(seen.grid(), latent)?;
        Ok(scores(&decoded, seen.log_radiance(), height, width, Alignment::LogFactor))
    }

    /// The same of a latent at the exposure of the picture.
    pub(super) fn score_exposed(&self, latent: &Latent, seen: &Observation) -> Result<Scores> {
        let log_exposure = latent.log_exposure - seen.log_exposure();
        self.score(&Latent { log_exposure, ..latent.clone() }, seen)
    }

    /// The best of the fits from every start.
    pub(super) fn best_of(
        &self,
        target: &FitTarget<'_>,
        starts: &[Latent],
        config: &FitConfig,
        observer: &mut dyn FnMut(u64, f64),
    ) -> veni_light::Result<Best> {
        match &self.decoder {
            Decoder::Folded(decoder) => best_of(decoder, target, starts, config, observer),
            #[cfg(feature = "learn")]
            Decoder::Graph(decoder) => best_of(decoder.as_ref(), target, starts, config, observer),
        }
    }
}

#[cfg(feature = "learn")]
fn decoder(model: &Model) -> veni_light::Result<Decoder> {
    match model.decoder() {
        Err(veni_light::Error::Unsupported { .. }) => {
            let device = veni_core::train::config::DeviceKind::Flex.device()?;
            Ok(Decoder::Graph(Box::new(veni_core::vae::Decoder::from_model(model, &device)?)))
        }
        folded => folded.map(Decoder::Folded),
    }
}

#[cfg(not(feature = "learn"))]
fn decoder(model: &Model) -> veni_light::Result<Decoder> {
    model.decoder().map(Decoder::Folded)
}
