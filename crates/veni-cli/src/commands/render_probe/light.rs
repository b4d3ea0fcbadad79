//! The light of a probe: a panorama's own pixels, or a decoded latent, on the grid of lights.

use std::path::Path;

use anyhow::{Result, bail};
use veni_light::latent::Latent;
use veni_light::sphere::Equirect;

use crate::args::{Layer, ModelArgs};
use crate::output::{CUBE_FACES, with_remedy};
use crate::report::Report;
use crate::source::{self, Loaded};

/// Radiance of every light of a file's panorama or latent, rotated by `turn` radians.
pub(super) fn from_file(
    path: &Path,
    layer: &Layer,
    model: &ModelArgs,
    grid: Equirect,
    turn: f64,
    report: Report,
) -> Result<Vec<[f32; 3]>> {
    if source::is_latent(path)? {
        let loaded = source::model_of(model, [path])?;
        let latent = source::from_file(path, layer, &loaded, report)?;
        return decode(&loaded, &latent, grid, turn);
    }
    if veni_image::attributes(path).map_err(with_remedy)?.contains_key(CUBE_FACES) {
        bail!("{}: a cube map is not a panorama; name an equirectangular image", path.display());
    }
    let image = source::panorama(path, layer, report)?;
    Ok(image.resample_rotated(grid, turn).into_pixels())
}

/// The same of a random sky.
pub(super) fn seeded(
    seed: u64,
    model: &ModelArgs,
    grid: Equirect,
    turn: f64,
    report: Report,
) -> Result<Vec<[f32; 3]>> {
    let loaded = source::model(model)?;
    let latent = source::RandomSkies::any(&loaded, report).sky(seed)?;
    decode(&loaded, &latent, grid, turn)
}

fn decode(loaded: &Loaded, latent: &Latent, grid: Equirect, turn: f64) -> Result<Vec<[f32; 3]>> {
    Ok(loaded.model.decoder()?.condition(&latent.rotated(turn))?.bake(grid))
}
