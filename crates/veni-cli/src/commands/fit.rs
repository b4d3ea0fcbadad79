//! `veni-cli fit`: pictures, and what else is known of a light, to latents, by optimisation.

mod band_sun;
mod completed;
mod images;
mod input;
mod integrals;
mod lit;
mod model;
mod rendered;
mod settings;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, bail};
use clap::Args;
use serde_json::json;
use veni_fit::{Best, FitConfig, Observation, best_light, random_starts};
use veni_image::Picture;
use veni_image::metrics::Scores;
use veni_light::latent::Latent;
use veni_light::output::Overwrite;

use crate::args::{Force, ModelArgs};
use crate::latent_files::{LatentFiles, in_words, source_of};
use crate::output::with_remedy;
use crate::piped;
use crate::printable::printable_json;
use crate::progress::ProgressBars;
use crate::report::{self, Outcome, Report, lines_to_stdout};
use crate::shard::Shard;
use crate::source;

use images::ImageArgs;
pub(crate) use input::Input;
use integrals::Integrals;
use lit::{Lit, LitArgs};
use model::FitModel;
use rendered::Rendered;
use settings::{Settings, Start};

/// Find the latent of a panorama, a part of one, a photograph, the light on a surface, or harmonics of light
#[derive(Args, Debug)]
#[command(
    long_about = "Find the latent of a panorama, a part of one, a photograph, the light on a surface, or harmonics of \
        light, by optimisation.\n\n\
        A panorama is OpenEXR, Radiance, PNG, JPEG or WebP, twice as wide as high, z up. Pixels that are not a number, \
        transparent, or black in --mask are unknown, and the latent completes them. With --fov the picture is a \
        photograph taken in the direction of --look. Values that a picture of limited range has clipped count as \"at least this \
        bright\". When part of the sphere is unknown, several starts are tried, the best is kept, and where they \
        disagree the completion is uncertain.\n\n\
        With --normals the picture shows a surface of known shape and material, whole or where --mask is white, and \
        the latent is the light under which its rendering looks like the picture ('veni-cli render-probe' makes such \
        pictures).\n\n\
        With --target-sh, --target-irradiance or --illuminance no picture is needed: the latent is a light that has these \
        harmonics, or that shines so on surfaces, and is likely otherwise by the model's prior. Radiance is of the files' \
        unit, directions of the native frame: z up, the middle of a panorama at +x, its left quarter at +y.",
    after_help = "Without -o and --out-dir the latent itself goes to stdout, one line of JSON per picture.\n\n\
        Examples:\n  \
        veni-cli fit sky.exr -o sky.json\n  \
        veni-cli fit *.exr --out-dir latents --shard 2/4     the second of four processes\n  \
        veni-cli fit half.exr --mask known.png -o sky.json --completed whole.exr --uncertainty std.png\n  \
        veni-cli fit photo.jpg --fov 65 --look 90,10 -o sky.json --completed whole.exr\n  \
        veni-cli fit ball.exr --normals n.exr --mask m.png --ks 0.2 -o light.json --completed light.exr\n  \
        veni-cli light sky.exr -o light.json && veni-cli fit --target-sh light.json -o sky.json\n  \
        veni-cli fit sky.exr --illuminance 20000 -o sky.json      radiance in cd/m², 20,000 lux on the ground\n  \
        veni-cli fit sky.exr --model 300 -o sky.json     a code of D = 300: vectors, the sun, 38 lobes for detail\n  \
        veni-cli fit sky.exr --preset display -o sky.json && veni-cli bake sky.json -o again.exr"
)]
pub(crate) struct Fit {
    #[command(flatten)]
    input: Input,

    #[command(flatten)]
    target: LatentFiles,

    #[command(flatten)]
    images: ImageArgs,

    #[command(flatten)]
    lit: LitArgs,

    #[command(flatten)]
    settings: Settings,

    #[command(flatten)]
    rendered: Rendered,

    #[command(flatten)]
    integrals: Integrals,

    #[command(flatten)]
    model: ModelArgs,

    #[command(flatten)]
    force: Force,

    #[command(flatten)]
    shard: Shard,
}

/// One picture's fit.
pub(crate) struct Fitted {
    best: Best,
    /// The share of the sphere that is known; nothing of it for the light on a surface.
    known: Option<f32>,
    /// Only of whole panoramas.
    scores: Option<Scores>,
    seconds: f64,
}

impl Fit {
    pub(crate) fn run(mut self, report: Report) -> Result<Outcome> {
        let overwrite = Overwrite::from(self.force);
        self.images.check(self.input.pictures.len(), self.shard, overwrite)?;
        let is_seen = !self.input.pictures.is_empty() && self.rendered.normals.is_none();
        if self.images.completed.is_some() && self.integrals.scales() && is_seen {
            bail!(
                "--illuminance gives the latent another unit than the picture's: leave --completed out, and bake the latent"
            );
        }
        if self.input.pictures.is_empty() {
            return self.unseen(overwrite, report);
        }
        let outputs = self.target.of(&self.input.pictures, overwrite, self.shard, report)?;
        self.input.keep()?;
        self.rendered.keep()?;
        let pictures = &self.input.pictures;
        self.shard.note_idle(pictures.len(), report);
        self.settings.grid(false)?;
        let model = FitModel::new(source::model(&self.model)?)?;
        // of part of the sphere the brightest is not known
        let whole = self.input.view().is_none() && self.input.mask().is_none();
        let lobes = self.rendered.normals.is_none() && self.lit.lobes(model.lobes()) > 0;
        let lit = model.lights() > 0 && whole || lobes;
        let config = self.settings.config(self.rendered.normals.is_some(), lit)?;
        report::each(pictures.iter().enumerate().filter(|(at, _)| self.shard.pick(*at)), |(at, path)| {
            self.one(&piped::input(path)?, outputs.get(at), &model, &config, report)
        })
    }

    fn one(
        &self,
        path: &Path,
        output: Option<&PathBuf>,
        model: &FitModel,
        config: &FitConfig,
        report: Report,
    ) -> Result<()> {
        let picture = self.input.read(path, report)?;
        let mut fitted = match &self.rendered.normals {
            Some(normals) => self.fit_light(path, normals, &picture, model, config, report)?,
            None => {
                let (grid, view) = (self.settings.grid(picture.is_partial())?, self.input.view());
                let most = self.lit.most(model.lights(), &picture, view.is_some(), report);
                let lit = Lit::new(&picture, most, LitArgs::widest(self.lit.lobes(model.lobes())))
                    .map_err(|e| e.in_file(path))?;
                let rest = lit.rest.as_ref().unwrap_or(&picture);
                let observation = self.input.observe(rest, grid).map_err(|e| e.in_file(path))?;
                let mut fitted = self.fit(path, &observation, model, config, report)?;
                if !observation.is_partial() && self.settings.exposure_is_open() {
                    lit.expose(&mut fitted.best, &observation, model)?;
                }
                lit.put_into(&mut fitted.best);
                if lit.lights.sun().is_none() {
                    self.lit.guess(&model.prior(), &mut fitted.best, &observation, report)?;
                }
                if !lit.lights.is_empty() && fitted.scores.is_some() {
                    let whole = self.input.observe(&picture, grid).map_err(|e| e.in_file(path))?;
                    fitted.scores = Some(model.score_exposed(&fitted.best.latent, &whole)?);
                }
                fitted
            }
        };
        self.integrals.scale(model, &mut fitted.best)?;
        let shown = self.rendered.normals.is_none().then_some(&picture);
        self.keep(&mut fitted.best, path, output, shown, model)?;
        self.print(path, output, &fitted, report)
    }

    /// The light of which only integrals are known.
    fn unseen(&self, overwrite: Overwrite, report: Report) -> Result<Outcome> {
        let name = self.integrals.name();
        self.shard.refuse("-o", true)?;
        let outputs = self.target.of(std::slice::from_ref(&name), overwrite, self.shard, report)?;
        let output = outputs.first();
        let model = FitModel::new(source::model(&self.model)?)?;
        self.check_starts(self.settings.start_unseen().1)?;
        let mut reached = self.integrals.fit(&self.settings, &model, report)?;
        self.keep(&mut reached.best, &name, output, None, &model)?;
        let (line, value) = self.integrals.results(output.map(PathBuf::as_path), &reached)?;
        if output.is_none() && !report.is_json() {
            report.note(line);
            lines_to_stdout(&format!("{}\n", printable_json(&reached.best.latent.to_json()?)))?;
        } else {
            report.result(line, &value)?;
        }
        Ok(Outcome::Fine)
    }

    /// Writes what a fit leaves.
    fn keep(
        &self,
        best: &mut Best,
        name: &Path,
        output: Option<&PathBuf>,
        seen: Option<&Picture>,
        model: &FitModel,
    ) -> Result<()> {
        let overwrite = Overwrite::from(self.force);
        best.latent.source = Some(source_of(name));
        best.latent.model = Some(model.hash());
        if let Some(output) = output {
            best.latent.save(output, overwrite).map_err(with_remedy)?;
        }
        let images =
            completed::Images { model, seen, view: self.input.view(), size: self.images.size, overwrite };
        if let Some(path) = &self.images.completed {
            images.completed(path, &best.latent)?;
        }
        if let Some(path) = &self.images.uncertainty {
            images.uncertainty(path, best)?;
        }
        Ok(())
    }

    fn fit(
        &self,
        path: &Path,
        observation: &Observation,
        model: &FitModel,
        config: &FitConfig,
        report: Report,
    ) -> Result<Fitted> {
        let started = Instant::now();
        let partial = observation.is_partial();
        let starts = self.starts(path, observation, model)?;
        self.check_starts(starts.len())?;
        let vectors = model.latent_vectors();
        let known = partial.then(|| observation.share());
        let config = self.settings.adapted(*config, known, vectors);
        let (total, prior) = (config.most_updates(vectors) * starts.len() as u64, model.prior());
        let progress = ProgressBars::new(report);
        progress.begin("", "step", Some(total));
        let target = observation.target().with_prior(&prior);
        let best = model.best_of(&target, &starts, &config, &mut |step, loss| {
            progress.advance(step, &format!("loss {loss:.4}"));
        });
        progress.end();
        let mut best = best.map_err(|e| e.in_file(path))?;
        if self.lit.lobes(model.lobes()) > 0 {
            best = self.lit.add_lobes(&best, &target, model, &config, report).map_err(|e| e.in_file(path))?;
        }
        let scores = match (partial, observation.clipped().is_some()) {
            (false, false) => Some(model.score(&best.latent, observation)?),
            _ => None,
        };
        // from the image's exposure 0 to its own
        for latent in best.all.iter_mut().chain([&mut best.latent]) {
            latent.log_exposure += observation.log_exposure();
        }
        let known = Some(observation.share());
        Ok(Fitted { best, known, scores, seconds: started.elapsed().as_secs_f64() })
    }

    /// The light on a surface.
    fn fit_light(
        &self,
        path: &Path,
        normals: &Path,
        picture: &Picture,
        model: &FitModel,
        config: &FitConfig,
        report: Report,
    ) -> Result<Fitted> {
        let started = Instant::now();
        let view = self.input.view();
        let image = self.rendered.image(normals, self.input.mask(), picture, view)?;
        let config = self.settings.for_light(*config);
        let (start, count) = self.settings.start(false, false);
        let n = model.latent_vectors();
        let first = match start {
            Start::Noise => None,
            Start::Zero => Some(Latent::new(vec![[0.0; 3]; n])),
            Start::Encoder => bail!(
                "{}: the encoder needs a panorama, not the rendered image of a surface: use --start zero or noise",
                path.display()
            ),
        };
        let rest = count - usize::from(first.is_some());
        let random = random_starts(&model.prior(), 0.0, rest, self.settings.seed());
        let mut starts: Vec<_> = first.into_iter().chain(random).collect();
        self.check_starts(starts.len())?;
        self.rendered.exposed(&image, picture, model, &mut starts)?;
        let prior = model.prior();
        let progress = ProgressBars::new(report);
        progress.begin("", "step", Some(config.steps * starts.len() as u64));
        let mut observer = |step, loss| progress.advance(step, &format!("loss {loss:.4}"));
        let best = best_light(model.decoder(), &image, Some(&prior), &starts, &config, &mut observer);
        progress.end();
        let mut best = best.map_err(|e| e.in_file(path))?;
        for latent in best.all.iter_mut().chain([&mut best.latent]) {
            latent.log_exposure = self.rendered.recorded(latent.log_exposure);
        }
        Ok(Fitted { best, known: None, scores: None, seconds: started.elapsed().as_secs_f64() })
    }

    /// One start has nothing to disagree with.
    fn check_starts(&self, starts: usize) -> Result<()> {
        match &self.images.uncertainty {
            Some(path) if starts < 2 => {
                bail!("{}: one start says nothing about uncertainty: give --starts 4 or more", path.display())
            }
            _ => Ok(()),
        }
    }

    /// The latents to start from, at the exposure that the observation was brought to.
    fn starts(&self, path: &Path, observation: &Observation, model: &FitModel) -> Result<Vec<Latent>> {
        let whole = !observation.is_partial();
        let has_encoder = model.has_encoder();
        let (start, count) = self.settings.start(whole, has_encoder);
        let n = model.latent_vectors();
        let first = match start {
            Start::Noise => None,
            Start::Zero => Some(Latent::new(vec![[0.0; 3]; n])),
            Start::Encoder if !whole => bail!(
                "{}: the encoder needs a whole panorama, and part of this one is unknown: use --start zero or noise",
                path.display()
            ),
            Start::Encoder if !has_encoder => {
                bail!("{}: this model has no encoder: use --start zero or noise", model.name())
            }
            Start::Encoder => model.encode(observation.grid(), observation.log_radiance())?,
        };
        let rest = count - usize::from(first.is_some());
        let random = random_starts(&model.prior(), 0.0, rest, self.settings.seed());
        Ok(first.into_iter().chain(random).collect())
    }

    fn print(&self, path: &Path, output: Option<&PathBuf>, fitted: &Fitted, report: Report) -> Result<()> {
        let Fitted { best, known, scores, seconds } = fitted;
        let text = best.latent.to_json()?;
        if report.is_json() {
            let value = json!({
                "picture": path.display().to_string(),
                "output": output.map(|o| o.display().to_string()),
                "known_share": known,
                "loss": best.loss,
                "losses": best.losses,
                "ldr_psnr": scores.map(|s| s.ldr_psnr),
                "hdr_psnr": scores.map(|s| s.hdr_psnr),
                "ssim": scores.map(|s| s.ssim),
                "seconds": seconds,
                "latent": serde_json::from_str::<serde_json::Value>(&text)?,
            });
            return report.result("", &value);
        }
        let Some(output) = output else {
            return lines_to_stdout(&format!("{}\n", printable_json(&text)));
        };
        let stops = best.latent.log_exposure / std::f32::consts::LN_2;
        let quality = match (scores, known) {
            (Some(s), _) => format!("LDR PSNR {:.1} dB", s.ldr_psnr),
            (None, Some(known)) => format!("{:.0} % of the sphere known", 100.0 * known),
            (None, None) => "from a rendered image".to_owned(),
        };
        let count = best.all.len();
        let starts = if count > 1 { format!(", best of {count} starts") } else { String::new() };
        report.result(
            format!(
                "{}: {}, exposure {stops:+.2} stops, loss {:.4}, {quality}{starts} ({seconds:.1} s)",
                output.display(),
                in_words(&best.latent),
                best.loss
            ),
            &(),
        )
    }
}
