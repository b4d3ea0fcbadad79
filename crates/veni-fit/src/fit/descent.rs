//! The ways down: Adam on everything at once, Levenberg–Marquardt image by image. MODEL (37).

use super::FitResult;
use super::config::{FitConfig, Method};
use super::levenberg_marquardt::{QuadraticModel, Search};
use super::network::{Evaluation, ImageLoss, Network};
use super::plateau::PlateauDetector;
use crate::{Adam, Error, Result};
use veni_light::latent::{Latent, Prior};

/// Latents and exposures with a low loss, by the configured method.
pub(super) fn optimise(
    network: &Network<'_>,
    loss: &ImageLoss<'_>,
    prior: Option<&Prior>,
    start: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    let n = start.first().map_or(0, |z| z.vectors.len());
    let standard = Prior::standard(n);
    let penalty = Penalty::new(prior.unwrap_or(&standard), config);
    let applies = network.is_folded() && loss.has_equations();
    if config.method == Method::LevenbergMarquardt && !applies {
        return Err(unsuited(loss));
    }
    let [explore, finish] = config.plan(n, applies);
    let descent = Descent { network, loss, penalty: &penalty, config };
    let mut trace = Trace { losses: Vec::new(), observer };
    let mut latents = start.to_vec();
    if explore > 0 {
        latents = descent.adam(&latents, explore, &mut trace)?;
    }
    if finish > 0 {
        latents = descent.levenberg_marquardt(&latents, finish, &mut trace)?;
    }
    let last = network.losses(&latents, loss)?;
    Ok(FitResult { latents, losses: trace.losses, last })
}

fn unsuited(loss: &ImageLoss<'_>) -> Error {
    let why = match loss {
        ImageLoss::Whole(_) => "the objective looks at whole images",
        ImageLoss::Rendered(_) => "the light on a surface is seen mixed, not pixel by pixel",
        ImageLoss::Pixels(_) | ImageLoss::Linear(_) => "this decoder cannot be folded",
    };
    Error::invalid(format!("the method levenberg-marquardt does not apply: {why}; use adam, or auto"))
}

/// scale · (−ln p) of a latent.
pub(super) struct Penalty<'a> {
    prior: &'a Prior,
    scale: f64,
}

impl<'a> Penalty<'a> {
    /// With the weight of the configuration.
    pub(super) fn new(prior: &'a Prior, config: &FitConfig) -> Self {
        Self { prior, scale: config.prior / prior.latent_vectors().max(1) as f64 }
    }

    /// Its value and gradient.
    pub(super) fn at(&self, vectors: &[[f32; 3]]) -> (f64, Vec<f64>) {
        if self.scale == 0.0 {
            return (0.0, vec![0.0; 3 * vectors.len()]);
        }
        let (energy, gradient) = self.prior.energy(vectors);
        (self.scale * energy, gradient.as_flattened().iter().map(|s| self.scale * s).collect())
    }

    /// Its Hessian, [3N, 3N]: the same everywhere, since it is a quadratic.
    pub(super) fn hessian(&self) -> Vec<f64> {
        let n = self.prior.latent_vectors();
        let mut vectors = vec![[0.0; 3]; n];
        let (_, origin) = self.at(&vectors);
        let mut rows = Vec::with_capacity(9 * n * n);
        for k in 0..3 * n {
            vectors.as_flattened_mut()[k] = 1.0;
            rows.extend(self.at(&vectors).1.iter().zip(&origin).map(|(a, b)| a - b));
            vectors.as_flattened_mut()[k] = 0.0;
        }
        rows
    }

    /// Added to the losses and gradients of all images.
    fn add_to(&self, vectors: &[f32], found: &mut Evaluation) {
        let count = 3 * self.prior.latent_vectors();
        let each = vectors.chunks_exact(count).zip(&mut found.losses);
        for ((z, loss), gradient) in each.zip(found.gradient.vectors.chunks_exact_mut(count)) {
            let (value, by) = self.at(z.as_chunks().0);
            *loss += value;
            gradient.iter_mut().zip(by).for_each(|(g, by)| *g += by);
        }
    }
}

/// What is minimised.
struct Descent<'a> {
    network: &'a Network<'a>,
    loss: &'a ImageLoss<'a>,
    penalty: &'a Penalty<'a>,
    config: &'a FitConfig,
}

/// The losses so far, and the callback that gets them.
struct Trace<'a> {
    losses: Vec<f64>,
    observer: &'a mut dyn FnMut(u64, f64),
}

impl Trace<'_> {
    /// The mean of the images' losses before an update.
    fn add(&mut self, losses: &[f64]) -> Result<()> {
        let value = losses.iter().sum::<f64>() / losses.len() as f64;
        let step = self.losses.len() as u64;
        if !value.is_finite() {
            return Err(Error::invalid(format!(
                "the fit's loss is {value} at step {step}; lower its learning rate, or start elsewhere"
            )));
        }
        (self.observer)(step, value);
        self.losses.push(value);
        Ok(())
    }
}

impl Descent<'_> {
    fn adam(&self, start: &[Latent], steps: u64, trace: &mut Trace<'_>) -> Result<Vec<Latent>> {
        let (n, config) = (self.penalty.prior.latent_vectors(), self.config);
        let flat = start.iter().flat_map(|z| z.vectors.as_flattened()).copied();
        let mut vectors: Vec<f32> = flat.collect();
        let mut exposures: Vec<f32> = start.iter().map(|z| z.log_exposure).collect();
        let mut by_vectors = Adam::new(vectors.len(), config.epsilon);
        let mut by_exposures = Adam::new(exposures.len(), config.epsilon);
        let add = |values: &mut [f32], changes: Vec<f64>| {
            values.iter_mut().zip(changes).for_each(|(x, by)| *x = (f64::from(*x) + by) as f32);
        };
        let latents = |vectors: &[f32], exposures: &[f32]| -> Vec<Latent> {
            let each = vectors.as_chunks().0.chunks_exact(n).map(<[[f32; 3]]>::to_vec);
            let both = each.zip(exposures);
            both.map(|(v, log_exposure)| Latent { log_exposure: *log_exposure, ..Latent::new(v) }).collect()
        };
        let mut plateau = PlateauDetector::new(config.plateau, start.len());
        for step in 0..steps {
            let mut found = self.network.evaluate(&latents(&vectors, &exposures), self.loss)?;
            self.penalty.add_to(&vectors, &mut found);
            trace.add(&found.losses)?;
            if plateau.ended(&found.losses) {
                break;
            }
            let rate = config.learning_rate.at(step);
            add(&mut vectors, by_vectors.step(&found.gradient.vectors, rate));
            if config.free_exposure {
                add(&mut exposures, by_exposures.step(&found.gradient.exposures, rate));
            }
        }
        Ok(latents(&vectors, &exposures))
    }

    /// Every image is a search of its own; they go side by side.
    fn levenberg_marquardt(
        &self,
        start: &[Latent],
        steps: u64,
        trace: &mut Trace<'_>,
    ) -> Result<Vec<Latent>> {
        let (hessian, free) = (self.penalty.hessian(), self.config.free_exposure);
        let evaluate = |latent: &Latent, b: usize| -> Result<QuadraticModel> {
            let found = self.network.equations(latent, self.loss, b)?;
            let (value, by) = self.penalty.at(&latent.vectors);
            Ok(QuadraticModel::new(found, latent.vectors.len(), free).plus(value, &by, &hessian))
        };
        let begin = |(b, latent): (usize, &Latent)| -> Result<Search> {
            Ok(Search::new(latent.clone(), evaluate(latent, b)?).with_progress(self.loss.progress()))
        };
        let mut searches = start.iter().enumerate().map(begin).collect::<Result<Vec<_>>>()?;
        for _ in 0..steps {
            trace.add(&searches.iter().map(Search::value).collect::<Vec<_>>())?;
            if searches.iter().all(Search::ended) {
                break;
            }
            for (b, search) in searches.iter_mut().enumerate().filter(|(_, search)| !search.ended()) {
                search.step(|latent| evaluate(latent, b))?;
            }
        }
        Ok(searches.into_iter().map(Search::into_latent).collect())
    }
}
