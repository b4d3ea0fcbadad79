//! The radiance that a file or a seed names.

use std::path::Path;

use anyhow::{Result, bail};
use veni_image::Panorama;
use veni_light::sphere::Equirect;

use crate::args::{Decoding, Layer};
use crate::device::Device;
use crate::output::{CUBE_FACES, with_remedy};
use crate::report::Report;
use crate::source;

/// Width at which a latent is decoded where none is asked for: decoded skies hold nothing finer than some degrees.
const WIDTH: usize = 2048;

/// A panorama as it is, a latent decoded `width` pixels wide.
pub(super) fn radiance(
    input: Option<&Path>,
    seed: Option<u64>,
    width: Option<usize>,
    decoding: &Decoding,
    layer: &Layer,
    report: Report,
) -> Result<Panorama> {
    if let Some(path) = input
        && !source::is_latent(path)?
    {
        let attributes = veni_image::attributes(path).map_err(with_remedy)?;
        if attributes.contains_key(CUBE_FACES) {
            bail!("{}: a cube map is not a panorama; name an equirectangular image", path.display());
        }
        return source::panorama(path, layer, report);
    }
    let loaded = source::model_of(&decoding.model, input)?;
    loaded.model.config().decoder.check_folds().map_err(|e| e.in_file(&loaded.name))?;
    let latent = match input {
        Some(path) => source::from_file(path, layer, &loaded, report)?,
        None => source::seeded(&loaded.model, seed.unwrap_or_default()),
    };
    let width = width.unwrap_or(WIDTH);
    let grid = Equirect::new(width, width / 2);
    let device = Device::open(decoding.device, &loaded.model, report)?;
    Ok(Panorama::new(grid, device.condition(&latent)?.bake(grid)?))
}
