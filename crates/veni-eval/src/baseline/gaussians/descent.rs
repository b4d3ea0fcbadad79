//! The search for the lobes: Adam from several starts.

use super::{Gaussians, greedy, shape};
use crate::baseline::target::Target;
use crate::{Error, Result};
use veni_fit::Adam;
use veni_light::random::{Purpose, stream};
use veni_light::vector::length;

/// The widest lobe, about a constant over the sphere.
const BLUNT: f64 = 0.05;

/// How the lobes are searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// The best of this many starts is taken. Each places lobe after lobe, always the one out of a dictionary that explains
    /// most of what is left; all but the first multiply these gains by random factors between ½ and 1.
    pub starts: u64,
    /// Adam steps of each start.
    pub steps: u32,
    /// Their rate at the start and at the end, exponential in between. A rate of 0.1 turns an axis by about 6° a step.
    pub rates: [f64; 2],
    /// Seed of the random starts.
    pub seed: u64,
}

impl Default for Search {
    fn default() -> Self {
        Self { starts: 4, steps: 200, rates: [0.1, 0.005], seed: 0 }
    }
}

impl Search {
    /// A single start of 50 steps: to see a trend.
    pub fn quick() -> Self {
        Self { starts: 1, steps: 50, ..Self::default() }
    }
}

/// A loss of free numbers, the first of which are the [shapes](shape).
pub(super) trait Problem {
    /// All free numbers for given shapes.
    fn start(&self, shapes: &[f64]) -> Vec<f64>;
    /// The loss and its gradient.
    fn loss(&self, x: &[f64]) -> (f64, Vec<f64>);
    /// What the numbers stand for.
    fn gaussians(&self, x: &[f64]) -> Gaussians;
    /// What is fitted.
    fn target(&self) -> &Target;
    /// Number of lobes.
    fn lobes(&self) -> usize;
}

impl Search {
    /// The best lobes found. None is narrower than a pixel: the image would not tell its shape.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no start, a rate is not in (0, 1], or the loss is never finite.
    pub(super) fn run(&self, problem: &impl Problem) -> Result<Gaussians> {
        if self.starts == 0 || self.rates.iter().any(|r| !(*r > 0.0 && *r <= 1.0)) {
            return Err(Error::invalid(format!(
                "spherical Gaussians: {} starts at rates {:?}; give at least one start and rates above 0, up to 1",
                self.starts, self.rates
            )));
        }
        let spacing = problem.target().spacing;
        let sharpest = (2.0 / (spacing * spacing)).max(2.0 * BLUNT);
        let mut best: Option<(f64, Vec<f64>)> = None;
        for start in 0..self.starts {
            let mut rng = stream(self.seed, Purpose::Fit, 0, start);
            let factor = || if start == 0 { 1.0 } else { 1.0 - 0.5 * rng.uniform() };
            let shapes = greedy::shapes(problem.target(), problem.lobes(), sharpest, factor);
            let (loss, x) = self.descend(problem, problem.start(&shapes), sharpest);
            if loss.is_finite() && best.as_ref().is_none_or(|(least, _)| loss < *least) {
                best = Some((loss, x));
            }
        }
        best.map(|(_, x)| problem.gaussians(&x)).ok_or_else(|| {
            Error::invalid(format!(
                "spherical Gaussians: no finite loss in {} starts at rates {:?}; lower the rates",
                self.starts, self.rates
            ))
        })
    }

    /// The best point on the way, with its loss.
    fn descend(&self, problem: &impl Problem, mut x: Vec<f64>, sharpest: f64) -> (f64, Vec<f64>) {
        let mut adam = Adam::new(x.len(), 1e-12);
        let mut best = (f64::INFINITY, x.clone());
        for step in 0..=self.steps {
            let (loss, gradient) = problem.loss(&x);
            if loss < best.0 {
                best = (loss, x.clone());
            }
            let part = f64::from(step) / f64::from(self.steps.max(1));
            let rate = self.rates[0].powf(1.0 - part) * self.rates[1].powf(part);
            x.iter_mut().zip(adam.step(&gradient, rate)).for_each(|(x, by)| *x += by);
            for v in x[..shape::FREE * problem.lobes()].chunks_exact_mut(shape::FREE) {
                // only the direction of the vector means something; at length 1 a step is an angle
                let length = length([v[0], v[1], v[2]]);
                v[..3].iter_mut().for_each(|c| *c /= length);
                v[3] = v[3].clamp(BLUNT.ln(), sharpest.ln());
            }
        }
        best
    }
}
