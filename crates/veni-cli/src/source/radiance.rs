//! The radiance that a file or a seed names: a panorama as it is, a latent decoded.

use std::path::Path;

use anyhow::{Result, bail};
use veni_image::Panorama;
use veni_light::sphere::Equirect;

use super::{RandomSkies, from_file, image, is_latent, model_of};
use crate::args::{Decoding, Layer};
use crate::device::Device;
use crate::output::{CUBE_FACES, with_remedy};
use crate::report::Report;

/// What was named.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Named<'a> {
    File(&'a Path),
    Seed(u64),
}

impl<'a> Named<'a> {
    /// From arguments of which clap demands one.
    pub(crate) fn new(input: Option<&'a Path>, seed: Option<u64>) -> Result<Self> {
        match (input, seed) {
            (Some(path), _) => Ok(Self::File(path)),
            (None, Some(seed)) => Ok(Self::Seed(seed)),
            (None, None) => bail!("name a panorama, a latent or a seed"),
        }
    }
}

/// A panorama, and whether it was decoded from a latent.
pub(crate) struct Radiance {
    /// For messages.
    pub(crate) name: String,
    pub(crate) panorama: Panorama,
    pub(crate) decoded: bool,
}

/// A panorama's own pixels; a latent is decoded on `grid`.
pub(crate) fn radiance(
    named: Named<'_>,
    layer: &Layer,
    decoding: &Decoding,
    grid: Equirect,
    report: Report,
) -> Result<Radiance> {
    let (name, input) = match named {
        Named::File(path) if !is_latent(path)? => {
            let name = path.display().to_string();
            if veni_image::attributes(path).map_err(with_remedy)?.contains_key(CUBE_FACES) {
                bail!("{name}: a cube map is not a panorama; name an equirectangular image");
            }
            return Ok(Radiance { name, panorama: image::panorama(path, layer, report)?, decoded: false });
        }
        Named::File(path) => (path.display().to_string(), Some(path)),
        Named::Seed(seed) => (format!("seed {seed}"), None),
    };
    let loaded = model_of(&decoding.model, input)?;
    loaded.model.config().decoder.check_folds().map_err(|e| e.in_file(&loaded.name))?;
    let latent = match named {
        Named::File(path) => from_file(path, layer, &loaded, report)?,
        Named::Seed(seed) => RandomSkies::any(&loaded, report).sky(seed)?,
    };
    let device = Device::open(decoding.device, &loaded.model, report)?;
    let panorama = Panorama::new(grid, device.condition(&latent)?.bake(grid)?);
    Ok(Radiance { name, panorama, decoded: true })
}
