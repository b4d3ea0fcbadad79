//! A light of which only integrals are known: harmonics, irradiance, illuminance.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, bail};
use clap::Args;
use serde_json::{Value, json};
use veni_fit::targets::{read_harmonics, read_surfaces};
use veni_fit::{
    Achieved, Best, FitConfig, LinearTarget, Received, best_linear, likely_searches, random_starts,
    refine_linear,
};
use veni_light::latent::Latent;
use veni_light::sphere::Equirect;

use super::band_sun::{BandSun, SHARES, SunAndRest};
use super::model::FitModel;
use super::settings::{Settings, Start};
use crate::numbers::positive;
use crate::piped;
use crate::progress::ProgressBars;
use crate::report::Report;

/// What a level surface faces.
const UP: [f32; 3] = [0.0, 0.0, 1.0];
/// Where the light on a level surface is summed: the edge of the cosine is a ten-thousandth of it.
const FINE: (usize, usize) = (256, 128);

#[derive(Args, Debug)]
#[command(next_help_heading = "Light that is not seen")]
pub(super) struct Integrals {
    // not as a doc comment, which takes brackets for links
    #[arg(
        help = "Instead of a picture: the spherical harmonics of radiance that the light is to have (JSON: what 'veni-cli \
        light -o' writes, or a list of [r,g,b]; 1, 4, 9, 16 ... of them, native frame, orthonormal, with the \
        Condon-Shortley sign)"
    )]
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pictures", "mask", "fov", "normals", "layer", "preset",
        "objective", "energy_weight", "exposure"])]
    target_sh: Option<PathBuf>,

    #[arg(help = "Instead of a picture, or beside --target-sh: what surfaces receive (JSON: a list of \
        {\"normal\":[x,y,z],\"irradiance\":[r,g,b]} or {\"normal\":[x,y,z],\"illuminance\":y}, or what 'veni-cli light -o' \
        writes)")]
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pictures", "mask", "fov", "normals", "layer", "preset",
        "objective", "energy_weight", "exposure"])]
    target_irradiance: Option<PathBuf>,

    /// Scale what is found so that a level surface receives this many lux, radiance being in cd/m²; alone, it is a
    /// likely light
    #[arg(long, value_name = "LUX", value_parser = positive)]
    illuminance: Option<f64>,
}

/// Harmonics that are further from what is wanted than this are tried with a sun.
const NEAR: f64 = 0.01;

/// How a latent is looked for.
#[derive(Clone, Copy)]
enum Search {
    /// From wherever the starts are.
    Whole,
    /// From what is right already on fewer pixels.
    Near,
}

/// What is to be fitted.
struct Wanted {
    target: LinearTarget,
    harmonics: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
}

/// What a fit has reached.
pub(super) struct Reached {
    pub(super) best: Best,
    achieved: Achieved,
    normals: Vec<[f32; 3]>,
    seconds: f64,
}

impl Integrals {
    /// Whether the latent is scaled to an illuminance.
    pub(super) fn scales(&self) -> bool {
        self.illuminance.is_some()
    }

    /// What outputs are called after.
    pub(super) fn name(&self) -> PathBuf {
        let files = self.target_sh.iter().chain(&self.target_irradiance);
        piped::names(&files.cloned().collect::<Vec<_>>())
            .into_iter()
            .next()
            .unwrap_or_else(|| "illuminance".into())
    }

    /// What is wanted: the target, its harmonics and the normals of its surfaces.
    fn read(&self, grid: Equirect) -> Result<Wanted> {
        let (mut target, mut harmonics) = (LinearTarget::new(grid), Vec::new());
        if let Some(path) = &self.target_sh {
            let path = piped::input(path)?;
            harmonics = read_harmonics(&path)?;
            target = target.harmonics(&harmonics).map_err(|e| e.in_file(&path))?;
        }
        let surfaces = match (&self.target_irradiance, &self.target_sh, self.illuminance) {
            (Some(path), _, _) => {
                let path = piped::input(path)?;
                let surfaces = read_surfaces(&path)?;
                target = target.surfaces(&surfaces).map_err(|e| e.in_file(&path))?;
                surfaces
            }
            (None, None, Some(lux)) => {
                let surfaces = vec![(UP, Received::Illuminance(lux))];
                target = target.surfaces(&surfaces)?;
                surfaces
            }
            _ => Vec::new(),
        };
        Ok(Wanted { target, harmonics, normals: surfaces.into_iter().map(|(normal, _)| normal).collect() })
    }

    /// Finds a latent with these integrals.
    pub(super) fn fit(&self, settings: &Settings, model: &FitModel, report: Report) -> Result<Reached> {
        let started = Instant::now();
        let grid = settings.grid(false)?;
        let Wanted { target, harmonics, normals } = self.read(grid)?;
        let config = settings.for_integrals(model.decoder().folded().is_some())?;
        let starts = starts(settings, model)?;
        // where the light is a quarter of the pixels: what it takes to be told from what it does not take
        let lead = target.coarser().unwrap_or_else(|| target.clone());
        let explored = |target: &LinearTarget| -> Result<(Best, Achieved)> {
            let mut starts = starts.clone();
            for start in &mut starts {
                start.log_exposure += target.matching_exposure(&model.decode(target.grid(), start)?);
            }
            let best = Self::search(target, &starts, Search::Whole, &config, model, report)?;
            let achieved = target.achieved(&model.decode(target.grid(), &best.latent)?);
            Ok((best, achieved))
        };
        let (mut best, achieved) = explored(&lead)?;
        // the vectors of a model that was trained without suns cannot be as bright on one side
        let sun = BandSun::new(&harmonics).filter(|_| normals.is_empty() && model.prior().sun().is_some());
        let (mut least, mut lit) = (achieved.harmonics_error, None);
        for share in SHARES {
            let (Some(sun), Some(NEAR..)) = (sun, least) else { break };
            let parted = SunAndRest::new(sun, share, &harmonics);
            let (other, reached) = explored(&LinearTarget::new(lead.grid()).harmonics(&parted.rest)?)?;
            let error = reached.harmonics_error.map(|error| error * parted.part);
            if error < least {
                (best, least, lit) = (other, error, Some(parted));
            }
        }
        let target = match &lit {
            Some(parted) => LinearTarget::new(grid).harmonics(&parted.rest)?,
            None => target,
        };
        let mut best = Self::search(&target, &best.all, Search::Near, &config, model, report)?;
        let mut achieved = target.achieved(&model.decode(grid, &best.latent)?);
        if let Some(parted) = &lit {
            parted.put_into(&mut best, &mut achieved);
        }
        let mut reached = Reached { best, achieved, normals, seconds: 0.0 };
        let factor = self.scale(model, &mut reached.best)?;
        let numbers = reached.achieved.harmonics.iter_mut().chain(&mut reached.achieved.surfaces);
        numbers.flatten().for_each(|v| *v *= factor);
        reached.seconds = started.elapsed().as_secs_f64();
        Ok(reached)
    }

    fn search(
        target: &LinearTarget,
        starts: &[Latent],
        search: Search,
        config: &FitConfig,
        model: &FitModel,
        report: Report,
    ) -> Result<Best> {
        let (prior, vectors) = (model.prior(), model.latent_vectors());
        let progress = ProgressBars::new(report);
        let (fit, searches): (fn(_, _, _, _, _, _) -> _, _) = match search {
            // the first start is led by weights of the prior and by resolutions
            Search::Whole => (best_linear, likely_searches(target) + starts.len() as u64 - 1),
            Search::Near => (refine_linear, starts.len() as u64),
        };
        progress.begin("", "step", Some(config.most_updates(vectors) * searches));
        let mut observer = |step, loss| progress.advance(step, &format!("loss {loss:.6}"));
        let best = fit(model.decoder(), target, &prior, starts, config, &mut observer);
        progress.end();
        Ok(best?)
    }

    /// Brings every latent to the illuminance that is wanted, if one is: exactly, since light is proportional to exp(exposure).
    /// Returns the best one's factor.
    pub(super) fn scale(&self, model: &FitModel, best: &mut Best) -> Result<f64> {
        let Some(lux) = self.illuminance else { return Ok(1.0) };
        let grid = Equirect::new(FINE.0, FINE.1);
        let level = LinearTarget::new(grid).surfaces(&[(UP, Received::Illuminance(lux))])?;
        let stops =
            |latent: &Latent| -> Result<f32> { Ok(level.matching_exposure(&model.decode(grid, latent)?)) };
        for latent in &mut best.all {
            latent.log_exposure += stops(latent)?;
        }
        let log_factor = stops(&best.latent)?;
        best.latent.log_exposure += log_factor;
        Ok(f64::from(log_factor).exp())
    }

    /// What is printed of a fit: for people, and for programs.
    pub(super) fn results(&self, output: Option<&Path>, reached: &Reached) -> Result<(String, Value)> {
        let Reached { best, achieved, normals, seconds } = reached;
        let n = best.latent.vectors.len();
        let mut line = String::new();
        if let Some(output) = output {
            line = format!("{}: ", output.display());
        }
        let stops = best.latent.log_exposure / std::f32::consts::LN_2;
        line += &format!("{n} vectors, exposure {stops:+.2} stops");
        let errors = [("harmonics", achieved.harmonics_error), ("irradiance", achieved.surfaces_error)];
        for (what, error) in errors {
            if let Some(error) = error {
                line += &format!(", {what} within {:.2} %", 100.0 * error);
            }
        }
        if let Some(lux) = self.illuminance {
            line += &format!(", {lux} lux");
        }
        if best.all.len() > 1 {
            line += &format!(", best of {} starts", best.all.len());
        }
        line += &format!(" ({seconds:.1} s)");
        let surface = |(normal, irradiance): (&[f32; 3], &[f64; 3])| json!({ "normal": normal, "irradiance": irradiance });
        let surfaces: Vec<_> = normals.iter().zip(&achieved.surfaces).map(surface).collect();
        let shown = |path: &Path| path.display().to_string();
        let value = json!({
            "target_sh": self.target_sh.as_deref().map(shown),
            "target_irradiance": self.target_irradiance.as_deref().map(shown),
            "illuminance": self.illuminance,
            "output": output.map(shown),
            "sh": achieved.harmonics,
            "sh_error": achieved.harmonics_error,
            "irradiance": surfaces,
            "irradiance_error": achieved.surfaces_error,
            "loss": best.loss,
            "losses": best.losses,
            "seconds": seconds,
            "latent": serde_json::from_str::<Value>(&best.latent.to_json()?)?,
        });
        Ok((line, value))
    }
}

/// Where the search begins: at 0, and at random if more starts are asked for.
fn starts(settings: &Settings, model: &FitModel) -> Result<Vec<Latent>> {
    let (start, count) = settings.start_unseen();
    let first = match start {
        Start::Noise => None,
        Start::Zero => Some(Latent::new(vec![[0.0; 3]; model.latent_vectors()])),
        Start::Encoder => bail!("--start encoder: there is no panorama to encode; use zero or noise"),
    };
    let rest = count - usize::from(first.is_some());
    let random = random_starts(&model.prior(), 0.0, rest, settings.seed());
    Ok(first.into_iter().chain(random).collect())
}
