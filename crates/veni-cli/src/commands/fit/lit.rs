//! A panorama and its compact lights apart.

use clap::{Args, value_parser};
use veni_fit::Best;
use veni_image::Picture;
use veni_light::Result;
use veni_light::latent::{Latent, Prior};
use veni_light::light::{LightOptions, Lights};
use veni_light::sphere::{Equirect, View};

use crate::report::Report;

#[derive(Args, Debug)]
pub(super) struct LitArgs {
    /// Take up to N compact lights (the sun, lamps) out of a whole panorama of high dynamic range before the fit, and put them into
    /// the latent [default: as many as the model was trained without]
    #[arg(long, value_name = "N", value_parser = value_parser!(u8).range(0..=8), conflicts_with_all = ["fov", "mask", "normals"])]
    compact_lights: Option<u8>,

    /// Of a photograph or part of a panorama that does not show the sun: put the sun into the latent that the model thinks most
    /// likely given what is seen, if it thinks that there is one at all
    #[arg(long, conflicts_with = "compact_lights")]
    likely_sun: bool,
}

impl LitArgs {
    /// The number of lights that are looked for in a picture, where a model was trained without `usual`: none in part
    /// of one (`view`: of a photograph), nor where values are cut off.
    pub(super) fn most(&self, usual: usize, picture: &Picture, view: bool, report: Report) -> usize {
        let [width, height] = picture.size();
        let seen = width == 2 * height && !picture.is_partial() && !view;
        let whole = seen && picture.clip().is_none() && picture.not_finite() == 0;
        let most = self.compact_lights.map_or(usual, usize::from);
        if most > 0 && !whole {
            report.note(
                "note: lights are measured in whole panoramas of high dynamic range; the latent of this picture has none",
            );
        }
        if whole { most } else { 0 }
    }

    /// The likely sun of every latent of a fit, if that is asked for, where it would not have been seen.
    pub(super) fn guess(
        &self,
        prior: &Prior,
        best: &mut Best,
        seen: &Seen,
        report: Report,
    ) -> anyhow::Result<()> {
        if !self.likely_sun {
            return Ok(());
        }
        if prior.sun().is_none() {
            anyhow::bail!("--likely-sun: the model knows nothing of suns; name another with --model");
        }
        let likely = |latent: &Latent| {
            let found = prior.likely_sun(&latent.vectors)?;
            (found.0 > 0.5 && !seen.has(found.1.direction)).then_some(found)
        };
        for latent in &mut best.all {
            latent.lights = Lights::new(likely(latent).map(|(_, light)| light), []);
        }
        let found = likely(&best.latent);
        match &found {
            Some((chance, light)) => report.note(format_args!(
                "a sun at {:.0}°, {:.0}° is likely ({:.0} %)",
                light.azimuth().to_degrees(),
                light.elevation().to_degrees(),
                100.0 * chance
            )),
            None => report.note("no sun is likely where none is seen"),
        }
        best.latent.lights = Lights::new(found.map(|(_, light)| light), []);
        Ok(())
    }
}

/// The part of the sphere that a picture shows.
pub(super) struct Seen {
    /// Of a photograph.
    pub(super) view: Option<View>,
    /// Of part of a panorama: how much of each pixel of `grid` is known.
    pub(super) mask: Option<Vec<f32>>,
    pub(super) grid: Equirect,
    /// Of the picture, pixels.
    pub(super) size: [usize; 2],
}

impl Seen {
    fn has(&self, direction: [f32; 3]) -> bool {
        match (self.view, &self.mask) {
            (Some(view), _) => {
                let [width, height] = self.size;
                view.pixel_of(direction, width, height).is_some()
            }
            (None, Some(mask)) => {
                let [column, row] = self.grid.pixel(direction).map(|v| v as usize);
                mask[row.min(self.grid.height - 1) * self.grid.width + column] > 0.5
            }
            (None, None) => true,
        }
    }
}

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

    /// The lights into every latent that was fitted to the rest, at its exposure.
    pub(super) fn put_into(&self, best: &mut Best) {
        for latent in best.all.iter_mut().chain([&mut best.latent]) {
            latent.lights = self.lights.scaled((-latent.log_exposure).exp());
        }
    }
}
