//! The panorama that is looked at: a file's own pixels, or a decoded latent.

use std::path::Path;

use anyhow::{Result, bail};
use veni_image::Panorama;
use veni_light::sphere::Equirect;

use crate::args::{Layer, ModelArgs};
use crate::output::{CUBE_FACES, SCENE, with_remedy};
use crate::report::Report;
use crate::source;

/// Width and height at which a latent is decoded, unless another is asked for.
const SIZE: (usize, usize) = (512, 256);

/// What was named.
pub(super) enum Named<'a> {
    File(&'a Path),
    Seed(u64),
}

/// What was read.
pub(super) struct Input {
    pub(super) name: String,
    pub(super) panorama: Panorama,
    /// cd/m² of one unit of luminance.
    pub(super) unit: f64,
}

/// Reads a panorama, or decodes a latent at this size.
pub(super) fn read(
    named: Named<'_>,
    model: &ModelArgs,
    layer: &Layer,
    size: Option<(usize, usize)>,
    report: Report,
) -> Result<Input> {
    let (width, height) = size.unwrap_or(SIZE);
    let grid = Equirect::new(width, height);
    let (name, loaded, latent) = match named {
        Named::Seed(seed) => {
            let loaded = source::model(model)?;
            let latent = source::seeded(&loaded.model, seed);
            (format!("seed {seed}"), loaded, latent)
        }
        Named::File(path) if source::is_latent(path)? => {
            let loaded = source::model_of(model, [path])?;
            let latent = source::from_file(path, layer, &loaded, report)?;
            (path.display().to_string(), loaded, latent)
        }
        Named::File(path) => {
            let attributes = veni_image::attributes(path).map_err(with_remedy)?;
            if attributes.contains_key(CUBE_FACES) {
                bail!("{}: a cube map is not a panorama; name an equirectangular image", path.display());
            }
            if size.is_some() {
                bail!(
                    "{}: a panorama is looked at as it is; --size is for what is decoded from a latent",
                    path.display()
                );
            }
            let unit = if attributes.contains_key(SCENE) { 1000.0 } else { 1.0 };
            let panorama = source::panorama(path, layer, report)?;
            return Ok(Input { name: path.display().to_string(), panorama, unit });
        }
    };
    let decoder = loaded.model.decoder().map_err(|e| e.in_file(&loaded.name))?;
    let field = decoder.condition(&latent).map_err(|e| e.in_file(&name))?;
    Ok(Input { panorama: Panorama::new(grid, field.bake(grid)), name, unit: 1.0 })
}
