//! A panorama through a model's encoder.

use std::path::Path;

use anyhow::{Result, bail};
use veni_data::Item;
use veni_fit::{Encoder, FitConfig, FitTarget, LobePlan, WIDEST_LIGHT, fit_lobes, lit_exposure};
use veni_image::Panorama;
use veni_image::metrics::{Alignment, Scores, scores};
use veni_light::field::{Decoder, Field};
use veni_light::latent::{Latent, Lobe};
use veni_light::light::LightOptions;
use veni_light::sphere::Equirect;

use super::image::panorama;
use super::model::Loaded;
use crate::args::Layer;
use crate::latent_files::source_of;
use crate::report::Report;

/// The resolution at which a panorama is encoded and scored: that of the training data of the paper.
const GRID: [usize; 2] = [128, 64];

/// A panorama's latent and how good it is.
pub(crate) struct Encoded {
    pub(crate) latent: Latent,
    pub(crate) scores: Scores,
    pub(crate) panorama: Panorama,
    pub(crate) field: Field,
}

/// A model's encoder, ready.
pub(crate) struct Encoding<'a> {
    loaded: &'a Loaded,
    encoder: Encoder,
    /// The number of lights that are taken out of a panorama and put into its latent.
    lights: usize,
    /// The number of lobes that are added.
    lobes: usize,
}

impl<'a> Encoding<'a> {
    /// With up to so many lights and lobes, or as many as codes of this model have.
    pub(crate) fn new(loaded: &'a Loaded, lights: Option<usize>, lobes: Option<usize>) -> Result<Self> {
        if !loaded.model.has_encoder() {
            bail!(
                "{}: this model has no encoder, it decodes only; name one that has with --model FILE",
                loaded.name
            );
        }
        let encoder = Encoder::new(&loaded.model).map_err(|e| e.in_file(&loaded.name))?;
        let lights = lights.unwrap_or(loaded.model.config().measured_lights());
        Ok(Self { loaded, encoder, lights, lobes: lobes.unwrap_or(loaded.lobes) })
    }

    /// Reads, encodes, and decodes again to compare.
    pub(crate) fn encode_file(&self, path: &Path, layer: &Layer, report: Report) -> Result<Encoded> {
        let panorama = panorama(path, layer, report)?;
        let grid = Equirect::new(GRID[0], GRID[1]);
        let whole = Item::new(path, &panorama, grid);
        let widest = if self.lobes > 0 { WIDEST_LIGHT } else { std::f32::consts::PI };
        let item = match self.lights {
            0 => whole.clone(),
            lights => {
                let options = LightOptions { lights, widest, ..LightOptions::default() };
                Item::split_by(path, panorama.clone(), grid, options).map_err(|e| e.in_file(path))?
            }
        };
        let encoded =
            self.encoder.encode(grid, &[&item.log_radiance]).map_err(|e| e.in_file(&self.loaded.name))?;
        let vectors = encoded.into_iter().next().map(|e| e.vectors).unwrap_or_default();
        let decoder = self.loaded.model.decoder().map_err(|e| e.in_file(&self.loaded.name))?;
        let lobes = self.lobes(&decoder, grid, &item.log_radiance, &vectors).map_err(|e| e.in_file(path))?;
        // of a panorama whose lights are apart
        let change = match self.lights {
            0 => 0.0,
            _ => {
                let rest = Latent { vectors: vectors.clone(), lobes: lobes.clone(), ..Latent::default() };
                let mut decoded = vec![[0.0; 3]; grid.len()];
                let field = decoder.condition(&rest).map_err(|e| e.in_file(path))?;
                field.log_radiance_batch(&grid.directions(), &mut decoded);
                lit_exposure(grid, &item.log_radiance, decoded.as_flattened(), &item.lights)
            }
        };
        let latent = Latent {
            vectors,
            lobes,
            lights: item.lights.scaled((-change).exp()),
            log_exposure: item.log_exposure + change,
            model: Some(self.loaded.model.hash()),
            source: Some(source_of(path)),
        };
        let field = decoder.condition(&latent).map_err(|e| e.in_file(path))?;
        // the paper's protocol, as in training, on the panorama as a whole
        let decoded = Panorama::new(grid, field.bake(grid)).log();
        let prediction: Vec<f32> = decoded.as_flattened().iter().map(|v| v - whole.log_exposure).collect();
        let scores = scores(&prediction, &whole.log_radiance, grid.height, grid.width, Alignment::LogFactor);
        Ok(Encoded { latent, scores, panorama, field })
    }

    /// What lobes add to the encoder's vectors, which stay as they are.
    fn lobes(
        &self,
        decoder: &Decoder,
        grid: Equirect,
        log_radiance: &[f32],
        vectors: &[[f32; 3]],
    ) -> veni_light::Result<Vec<Lobe>> {
        if self.lobes == 0 {
            return Ok(Vec::new());
        }
        let (images, plan) = ([log_radiance], LobePlan { count: self.lobes, only_lobes: true });
        let target = FitTarget::panoramas(grid, &images)?;
        let start = [Latent::new(vectors.to_vec())];
        let found = fit_lobes(decoder, &target, &start, plan, &FitConfig::lit(), &mut |_, _| {})?;
        Ok(found.into_iter().flat_map(|(latent, _)| latent.lobes).collect())
    }
}
