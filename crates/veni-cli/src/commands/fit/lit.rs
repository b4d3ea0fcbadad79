//! A panorama and its compact lights apart.

use clap::{Args, value_parser};
use veni_fit::{
    Best, FitConfig, FitTarget, LobePlan, Observation, WIDEST_LIGHT, fit_lobes, lit_exposure, unseen,
};
use veni_image::Picture;
use veni_light::Result;
use veni_light::latent::{Latent, Prior};
use veni_light::light::Lights;

use super::model::FitModel;
use crate::progress::ProgressBars;
use crate::report::Report;

#[derive(Args, Debug)]
pub(super) struct LitArgs {
    /// Take up to N compact lights (the sun, lamps) out of what is known of a panorama of high dynamic range before the fit, and put
    /// them into the latent [default: 4 with a model that was trained without lights, otherwise 0]
    #[arg(long, value_name = "N", value_parser = value_parser!(u8).range(0..=8), conflicts_with_all = ["fov", "normals"])]
    compact_lights: Option<u8>,

    /// Add K spherical Gaussians to the latent, which fit what its vectors leave of the picture, and the vectors with them: detail
    /// of 7 numbers each. Lights are then no wider than 1.5° [default: those of --model 147 and 300, 16 and 38, else 0]
    #[arg(long, value_name = "K", value_parser = value_parser!(u16).range(0..=256), conflicts_with = "normals")]
    lobes: Option<u16>,

    /// Of a photograph or part of a panorama that does not show the sun: put the sun into the latent that the model thinks most
    /// likely given what is seen, if it thinks that there is one at all
    #[arg(long, conflicts_with = "compact_lights")]
    likely_sun: bool,
}

impl LitArgs {
    /// The number of lobes that are added, `usual` unless somebody said otherwise.
    pub(super) fn lobes(&self, usual: usize) -> usize {
        self.lobes.map_or(usual, usize::from)
    }

    /// The angular radius of the widest light beside so many lobes, radians.
    pub(super) fn widest(lobes: usize) -> f32 {
        if lobes > 0 { WIDEST_LIGHT } else { std::f32::consts::PI }
    }

    /// The number of lights that are looked for in a picture, `usual` unless somebody said otherwise: none in a photograph
    /// (`view`), nor where values are cut off.
    pub(super) fn most(&self, usual: usize, picture: &Picture, view: bool, report: Report) -> usize {
        let [width, height] = picture.size();
        let measured = width == 2 * height && !view && picture.clip().is_none();
        let most = self.compact_lights.map_or(usual, usize::from);
        if most > 0 && !measured {
            report.note(
                "note: lights are measured in panoramas of high dynamic range; the latent of this picture has none",
            );
        }
        if measured { most } else { 0 }
    }

    /// The lobes into the latents of all starts, and the best of them again.
    pub(super) fn add_lobes(
        &self,
        best: &Best,
        target: &FitTarget<'_>,
        model: &FitModel,
        config: &FitConfig,
        report: Report,
    ) -> Result<Best> {
        let plan = LobePlan { count: self.lobes(model.lobes()), only_lobes: false };
        let progress = ProgressBars::new(report);
        progress.begin("lobes", "start", Some(best.all.len() as u64));
        let one = |latent: &Latent| {
            let start = std::slice::from_ref(latent);
            let found = fit_lobes(model.decoder(), target, start, plan, config, &mut |_, _| {})?;
            progress.add(1);
            Ok(found)
        };
        let found = best.all.iter().map(one).collect::<Result<Vec<_>>>();
        progress.end();
        let (all, losses) = found?.into_iter().flatten().unzip();
        Ok(Best::of(all, losses))
    }

    /// The likely sun of every latent of a fit, if that is asked for, where it would not have been seen.
    pub(super) fn guess(
        &self,
        prior: &Prior,
        best: &mut Best,
        seen: &Observation,
        report: Report,
    ) -> anyhow::Result<()> {
        if !self.likely_sun {
            return Ok(());
        }
        if prior.sun().is_none() {
            anyhow::bail!("--likely-sun: the model knows nothing of suns; name another with --model");
        }
        let likely = |latent: &Latent| {
            let found = unseen::likely_sun(prior, latent, seen);
            (Lights::new(found.map(|(_, sun)| sun), latent.lights.others().iter().copied()), found)
        };
        for latent in &mut best.all {
            latent.lights = likely(latent).0;
        }
        let (lights, found) = likely(&best.latent);
        match &found {
            Some((chance, light)) => report.note(format_args!(
                "a sun at {:.0}°, {:.0}° is likely ({:.0} %)",
                light.azimuth().to_degrees(),
                light.elevation().to_degrees(),
                100.0 * chance
            )),
            None => report.note("no sun is likely where none is seen"),
        }
        best.latent.lights = lights;
        Ok(())
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
    /// Up to `most` lights of what is known of a panorama, none wider than `widest`.
    pub(super) fn new(picture: &Picture, most: usize, widest: f32) -> Result<Self> {
        if most == 0 {
            return Ok(Self { rest: None, lights: Lights::default() });
        }
        let (rest, lights) = unseen::seen_lights(picture, most, widest)?;
        Ok(Self { rest: Some(rest), lights })
    }

    /// Every latent at the exposure at which surfaces get the light of the whole panorama, where lights were looked for.
    pub(super) fn expose(&self, best: &mut Best, seen: &Observation, model: &FitModel) -> anyhow::Result<()> {
        if self.rest.is_none() {
            return Ok(());
        }
        // in the unit of the observation
        let lights = self.lights.scaled((-seen.log_exposure()).exp());
        for latent in best.all.iter_mut().chain([&mut best.latent]) {
            let log_exposure = latent.log_exposure - seen.log_exposure();
            let decoded = model.decode(seen.grid(), &Latent { log_exposure, ..latent.clone() })?;
            latent.log_exposure += lit_exposure(seen.grid(), seen.log_radiance(), &decoded, &lights);
        }
        Ok(())
    }

    /// The lights into every latent that was fitted to the rest, at its exposure.
    pub(super) fn put_into(&self, best: &mut Best) {
        for latent in best.all.iter_mut().chain([&mut best.latent]) {
            latent.lights = self.lights.scaled((-latent.log_exposure).exp());
        }
    }
}
