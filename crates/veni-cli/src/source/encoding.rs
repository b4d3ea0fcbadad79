//! A panorama through a model's encoder.

use std::path::Path;

use anyhow::{Result, bail};
use veni_data::Item;
use veni_fit::Encoder;
use veni_image::Panorama;
use veni_image::metrics::{Alignment, Scores, scores};
use veni_light::field::Field;
use veni_light::latent::Latent;
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
}

impl<'a> Encoding<'a> {
    /// With as many lights as the model's codes have, or as are asked for.
    pub(crate) fn new(loaded: &'a Loaded, lights: Option<usize>) -> Result<Self> {
        if !loaded.model.has_encoder() {
            bail!(
                "{}: this model has no encoder, it decodes only; name one that has with --model FILE",
                loaded.name
            );
        }
        let encoder = Encoder::new(&loaded.model).map_err(|e| e.in_file(&loaded.name))?;
        Ok(Self { loaded, encoder, lights: lights.unwrap_or(loaded.model.config().lights) })
    }

    /// Reads, encodes, and decodes again to compare.
    pub(crate) fn encode_file(&self, path: &Path, layer: &Layer, report: Report) -> Result<Encoded> {
        let panorama = panorama(path, layer, report)?;
        let grid = Equirect::new(GRID[0], GRID[1]);
        let whole = Item::new(path, &panorama, grid);
        let item = match self.lights {
            0 => whole.clone(),
            most => Item::split(path, panorama.clone(), grid, most).map_err(|e| e.in_file(path))?,
        };
        let encoded =
            self.encoder.encode(grid, &[&item.log_radiance]).map_err(|e| e.in_file(&self.loaded.name))?;
        let vectors = encoded.into_iter().next().map(|e| e.vectors).unwrap_or_default();
        let latent = Latent {
            vectors,
            lights: item.lights,
            log_exposure: item.log_exposure,
            model: Some(self.loaded.model.hash()),
            source: Some(source_of(path)),
            ..Latent::default()
        };
        let decoder = self.loaded.model.decoder().map_err(|e| e.in_file(&self.loaded.name))?;
        let field = decoder.condition(&latent).map_err(|e| e.in_file(path))?;
        // the paper's protocol, as in training, on the panorama as a whole
        let decoded = Panorama::new(grid, field.bake(grid)).log();
        let prediction: Vec<f32> = decoded.as_flattened().iter().map(|v| v - whole.log_exposure).collect();
        let scores = scores(&prediction, &whole.log_radiance, grid.height, grid.width, Alignment::LogFactor);
        Ok(Encoded { latent, scores, panorama, field })
    }
}
