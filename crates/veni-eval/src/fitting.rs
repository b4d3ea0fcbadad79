//! The one place where evaluation calls the latent optimiser.

use serde_json::json;

use crate::Result;
use crate::canonical::Canonical;
use veni_core::LoadedModel;
use veni_core::fit::{self, FitConfig, FitResult, FitTarget, Method};
use veni_data::coarsen::{averaged, coarse_grid};
use veni_fit::{Observation, unseen};
use veni_image::Picture;
use veni_light::latent::Latent;
use veni_light::light::Lights;
use veni_light::sphere::{Equirect, View};

/// How a latent is fitted to an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// Objective, steps, rates.
    pub config: FitConfig,
    /// The fit sees means over squares of this many pixels a side.
    pub factor: usize,
}

impl FitSettings {
    /// [`FitConfig::thorough`] on a quarter of the pixels; `quick`: at most 100 steps on a sixteenth.
    pub fn thorough(grid: Equirect, quick: bool) -> Self {
        let config = FitConfig::thorough();
        let config = if quick { config.in_steps(100) } else { config };
        Self { config, factor: dividing(grid, if quick { 4 } else { 2 }) }
    }

    /// With the objective of codes with lights, [`FitConfig::lit`].
    #[must_use]
    pub fn lit(self) -> Self {
        Self { config: FitConfig { objective: FitConfig::lit().objective, ..self.config }, ..self }
    }

    /// The reference implementation's helper: 2000 steps on every pixel, rates from `rates[0]` to `rates[1]`; `quick`:
    /// 300 steps on a sixteenth of the pixels.
    pub fn reference(grid: Equirect, rates: [f64; 2], quick: bool) -> Self {
        let [first, last] = rates;
        let steps = if quick { 300 } else { 2000 };
        let config = FitConfig::reference_helper(first, last, steps);
        Self { config, factor: if quick { dividing(grid, 4) } else { 1 } }
    }

    /// Everything that decides a result.
    pub fn key(&self) -> Canonical {
        Canonical::of(json!({ "config": self.config, "factor": self.factor }))
    }

    /// In words, for tables.
    pub fn describe(&self) -> String {
        let every = match self.factor {
            1 => "every pixel".to_owned(),
            n => format!("means over {n} × {n} pixels"),
        };
        let steps = self.config.steps;
        match self.config.method {
            Method::Adam => format!("{steps} Adam steps on {every}"),
            Method::LevenbergMarquardt => format!("Levenberg–Marquardt to the end on {every}"),
            Method::Auto => format!(
                "Levenberg–Marquardt to the end, with more than 16 vectors after {steps} exploring Adam steps (where it \
                 does not apply: those alone), on {every}"
            ),
        }
    }

    /// Fits one latent to each image (log radiance at exposure 0 on `grid`).
    ///
    /// # Errors
    /// As [`fit::fit`].
    pub fn fit(
        &self,
        subject: &LoadedModel,
        grid: Equirect,
        images: &[&[f32]],
        start: &[Latent],
    ) -> Result<FitResult> {
        let images: Vec<_> = images.iter().map(|image| averaged(grid, image, self.factor)).collect();
        let images: Vec<_> = images.iter().map(Vec::as_slice).collect();
        let grid = coarse_grid(grid, self.factor);
        let target = FitTarget::panoramas(grid, &images)?;
        fit::fit(subject.fit_decoder(), &target, start, &self.config)
    }
}

/// How a latent is fitted to what shows part of the sphere: as `veni-cli fit --likely-sun` does it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnseenSettings {
    /// At most 100 steps.
    quick: bool,
    /// Of the starts.
    seed: u64,
}

impl UnseenSettings {
    /// [`unseen::config`]; `quick`: at most 100 steps.
    pub fn new(seed: u64, quick: bool) -> Self {
        Self { quick, seed }
    }

    fn config(&self, known: f32) -> FitConfig {
        let config = unseen::config(known);
        if self.quick { config.in_steps(100) } else { config }
    }

    /// Everything that decides a result, beside model and picture.
    pub fn key(&self) -> Canonical {
        let grid = [unseen::GRID.width, unseen::GRID.height, unseen::LONGEST];
        Canonical::of(
            json!({ "config": self.config(1.0), "seed": self.seed, "starts": unseen::STARTS, "sizes": grid }),
        )
    }

    /// The latent of a photograph taken by `view`, or of what is known of a panorama, at the picture's exposure; with the compact
    /// lights in sight of a panorama, and the sun that is likely where none is seen.
    ///
    /// # Errors
    /// As [`fit::best_of`]; if the picture is black or unknown.
    pub fn fit(&self, subject: &LoadedModel, picture: &Picture, view: Option<&View>) -> Result<Latent> {
        let most = subject.lights();
        let (observation, lights) = match view {
            Some(view) => (Observation::photograph(picture, view, unseen::LONGEST)?, Lights::default()),
            None if most == 0 => (Observation::panorama(picture, unseen::GRID)?, Lights::default()),
            None => {
                let (rest, lights) = unseen::seen_lights(picture, most, std::f32::consts::PI)?;
                (Observation::panorama(&rest, unseen::GRID)?, lights)
            }
        };
        let prior = subject.prior();
        let (target, starts) = (observation.target().with_prior(&prior), unseen::starts(&prior, self.seed));
        let config = self.config(observation.share());
        let mut latent =
            fit::best_of(subject.fit_decoder(), &target, &starts, &config, &mut |_, _| {})?.latent;
        latent.log_exposure += observation.log_exposure();
        latent.lights = lights.scaled((-latent.log_exposure).exp());
        if latent.lights.sun().is_none() {
            let sun = unseen::likely_sun(&prior, &latent, &observation).map(|(_, sun)| sun);
            latent.lights = Lights::new(sun, latent.lights.others().iter().copied());
        }
        Ok(latent)
    }
}

/// The largest of `most`, `most`/2, … that divides both sides.
pub(crate) fn dividing(grid: Equirect, most: usize) -> usize {
    let divides = |n: &usize| grid.width.is_multiple_of(*n) && grid.height.is_multiple_of(*n);
    std::iter::successors(Some(most), |n| (*n > 1).then_some(n / 2)).find(divides).unwrap_or(1)
}
