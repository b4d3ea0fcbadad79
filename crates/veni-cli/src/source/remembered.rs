//! Whether the latent that a baked image carries is still that of its pixels: other software changes pixels and keeps
//! attributes.

use std::path::Path;

use anyhow::Result;
use clap::ValueEnum;
use veni_image::{Panorama, Provenance, ReadOptions};
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::{Equirect, Frame};

use crate::device::Directions;
use crate::output::{CUBE_FACES, FRAME, with_remedy};
use crate::picture::FrameName;

/// About as many pixels are decoded again where no digest was recorded.
const SAMPLES: usize = 4096;
/// Of a pixel's brightest channel: more than half precision, RGBE and another device's rounding take.
const TOLERANCE: f32 = 0.01;
/// What half precision rounds to nothing.
const NOTHING: f32 = 6e-8;

/// Whether the pixels of the image `path` are those that its latent gave. Files of older versions record no digest of
/// their pixels: some of them are decoded again.
pub(super) fn is_of_its_pixels(path: &Path, latent: &Latent, model: &Model) -> Result<bool> {
    let options = ReadOptions { any_aspect: true, ..ReadOptions::default() };
    let image = Panorama::read_with(path, &options).map_err(with_remedy)?;
    match image.provenance() {
        Provenance::Same => Ok(true),
        Provenance::Changed => Ok(false),
        Provenance::Unrecorded => is_decoded(&image, latent, model),
    }
}

fn is_decoded(image: &Panorama, latent: &Latent, model: &Model) -> Result<bool> {
    let grid = image.grid();
    let Some(of) = directions(image) else { return Ok(false) };
    let step = grid.len().div_ceil(SAMPLES) | 1;
    let at: Vec<usize> = (0..grid.len()).step_by(step).collect();
    let directions: Vec<_> = at.iter().map(|at| of.at(at % grid.width, at / grid.width)).collect();
    let mut decoded = vec![[0.0; 3]; at.len()];
    model.decoder()?.condition(latent)?.radiance_batch(&directions, &mut decoded);
    Ok(at.iter().zip(&decoded).all(|(at, decoded)| is_near(image.pixels()[*at], *decoded)))
}

fn is_near(stored: [f32; 3], decoded: [f32; 3]) -> bool {
    let allowed = NOTHING + TOLERANCE * decoded.into_iter().fold(0.0, f32::max);
    stored.iter().zip(decoded).all(|(a, b)| (a - b).abs() <= allowed)
}

/// Those of a panorama, or of a cube map; `None` for another shape.
fn directions(image: &Panorama) -> Option<Directions> {
    let grid @ Equirect { width, height } = image.grid();
    if !image.attributes().contains_key(CUBE_FACES) {
        return (width == 2 * height).then_some(Directions::Equirect(grid));
    }
    let name = image.attributes().get(FRAME)?;
    let frame = Frame::from(<FrameName as ValueEnum>::from_str(name, true).ok()?);
    (height == 6 * width).then_some(Directions::Cube { edge: width, frame })
}
