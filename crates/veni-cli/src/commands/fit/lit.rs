//! A panorama and its compact lights apart.

use veni_image::Picture;
use veni_light::Result;
use veni_light::light::{LightOptions, Lights};
use veni_light::sphere::Equirect;

/// What is left of a picture without its lights, and these.
pub(super) struct Lit {
    /// None: nothing was taken out.
    pub(super) rest: Option<Picture>,
    /// In units of the picture's radiance.
    pub(super) lights: Lights,
}

impl Lit {
    /// Up to `most` lights of a whole panorama.
    pub(super) fn new(picture: &Picture, most: usize) -> Result<Self> {
        if most == 0 {
            return Ok(Self { rest: None, lights: Lights::default() });
        }
        let [width, height] = picture.size();
        // of a resampled panorama values may be a little below 0
        let pixels = picture.pixels().iter().map(|p| p.map(|v| v.max(0.0))).collect();
        let options = LightOptions { lights: most, ..LightOptions::default() };
        let light = options.of_pixels(Equirect::new(width, height), pixels)?;
        let lights = light.lights().clone();
        Ok(Self { rest: Some(Picture::new([width, height], light.into_residual())?), lights })
    }
}
