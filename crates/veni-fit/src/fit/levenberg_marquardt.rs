//! The method of Levenberg and Marquardt on one latent: Gauss–Newton steps, held back as far as their model of the loss
//! proves wrong. MODEL (42).
//!
//! A step δ solves (H + λ D) δ = −g with H and g of the [normal equations](veni_light::field::NormalEquations) and D the
//! diagonal of H. It is taken if the loss falls; λ follows the ratio of the fall to the one that was promised, by
//! the rule of Nielsen (1999, Damping Parameter in Marquardt's Method).

use crate::Result;
use veni_light::cholesky;
use veni_light::field::{MAX_COORDINATE, NormalEquations};
use veni_light::latent::{Latent, Lobe};

/// λ at first.
const DAMPING: f64 = 1e-2;
/// Beyond this λ a step is too short to matter.
const MOST_DAMPING: f64 = 1e8;
/// Least diagonal element of D, in parts of the largest: coordinates that hardly matter stay where they are.
const FLOOR: f64 = 1e-6;
/// A fall of the loss by less than this fraction is not progress, unless a search is told otherwise, and N of them in a row end it.
pub(super) const PROGRESS: f64 = 1e-4;
const PATIENCE: u32 = 3;

/// The local quadratic of the loss at a latent, prior included: over the coordinates that may move.
#[derive(Debug)]
pub(super) struct QuadraticModel {
    value: f64,
    gradient: Vec<f64>,
    matrix: Vec<f64>,
    /// The number of vectors among the coordinates, which come first.
    vectors: usize,
    /// Whether the exposure follows them; lobes come last.
    free: bool,
}

impl QuadraticModel {
    /// Of `vectors` vectors, the exposure if it is `free`, and the lobes if the equations have them.
    pub(super) fn new(equations: NormalEquations, vectors: usize, free: bool) -> Self {
        let NormalEquations { loss: value, mut gradient, mut matrix } = equations;
        if !free {
            let (n, exposure) = (gradient.len(), 3 * vectors);
            gradient.remove(exposure);
            let kept = matrix.iter().enumerate().filter(|(k, _)| k / n != exposure && k % n != exposure);
            matrix = kept.map(|(_, value)| *value).collect();
        }
        Self { value, gradient, matrix, vectors, free }
    }

    /// Of lobes alone.
    pub(super) fn of_lobes(equations: NormalEquations) -> Self {
        let NormalEquations { loss: value, gradient, matrix } = equations;
        Self { value, gradient, matrix, vectors: 0, free: false }
    }

    /// With a penalty on the vectors' coordinates added.
    pub(super) fn plus(mut self, value: f64, gradient: &[f64], hessian: &[f64]) -> Self {
        let (n, m) = (self.gradient.len(), gradient.len());
        self.value += value;
        self.gradient.iter_mut().zip(gradient).for_each(|(g, by)| *g += by);
        for (row, more) in self.matrix.chunks_exact_mut(n).zip(hessian.chunks_exact(m)) {
            row.iter_mut().zip(more).for_each(|(h, more)| *h += more);
        }
        self
    }

    /// With weight · |a|² added for the amplitude a of every lobe.
    pub(super) fn with_small_lobes(mut self, latent: &Latent, weight: f64) -> Self {
        let (n, first) = (self.gradient.len(), 3 * self.vectors + usize::from(self.free));
        for (k, lobe) in latent.lobes.iter().enumerate() {
            for (c, amplitude) in lobe.amplitude.into_iter().enumerate() {
                let (amplitude, at) = (f64::from(amplitude), first + Lobe::COORDINATES * k + c);
                self.value += weight * amplitude * amplitude;
                self.gradient[at] += 2.0 * weight * amplitude;
                self.matrix[at * (n + 1)] += 2.0 * weight;
            }
        }
        self
    }

    /// δ at damping λ, and the fall of the loss that it promises; nothing if the matrix is not positive definite.
    fn step(&self, damping: f64) -> Option<(Vec<f64>, f64)> {
        let n = self.gradient.len();
        let largest = (0..n).map(|i| self.matrix[i * (n + 1)]).fold(0.0, f64::max);
        let scale = |i: usize| self.matrix[i * (n + 1)].max(FLOOR * largest);
        let mut factor = self.matrix.clone();
        (0..n).for_each(|i| factor[i * (n + 1)] += damping * scale(i));
        cholesky::factor(&mut factor, n)?;
        let mut step: Vec<[f64; 1]> = self.gradient.iter().map(|g| [-g]).collect();
        cholesky::substitute(&factor, n, &mut step);
        let step = step.into_flattened();
        // −gᵀδ − ½ δᵀHδ with H δ = −g − λ D δ
        let terms = step.iter().zip(&self.gradient).enumerate();
        let fall = terms.map(|(i, (d, g))| 0.5 * d * (damping * scale(i) * d - g)).sum();
        Some((step, fall))
    }
}

/// One latent on its way.
#[derive(Debug)]
pub(super) struct Search {
    latent: Latent,
    at: QuadraticModel,
    damping: f64,
    growth: f64,
    idle: u32,
    /// A fall by less than this fraction is not progress.
    progress: f64,
    /// The least and the largest of a lobe.
    sharpness: [f32; 2],
}

impl Search {
    pub(super) fn new(latent: Latent, at: QuadraticModel) -> Self {
        let sharpness = [f32::MIN_POSITIVE, f32::MAX];
        Self { latent, at, damping: DAMPING, growth: 2.0, idle: 0, progress: PROGRESS, sharpness }
    }

    /// For which a fall of the loss by less than this fraction is not progress.
    pub(super) fn with_progress(self, progress: f64) -> Self {
        Self { progress, ..self }
    }

    /// With lobes of sharpnesses from `least` to `largest`.
    pub(super) fn with_sharpness(self, [least, largest]: [f32; 2]) -> Self {
        Self { sharpness: [least, largest], ..self }
    }

    /// The loss, prior included.
    pub(super) fn value(&self) -> f64 {
        self.at.value
    }

    /// Whether no further step is worth it.
    pub(super) fn ended(&self) -> bool {
        self.idle >= PATIENCE || self.damping > MOST_DAMPING
    }

    pub(super) fn into_latent(self) -> Latent {
        self.latent
    }

    /// Tries a step, and takes it if the loss falls.
    pub(super) fn step(&mut self, evaluate: impl FnOnce(&Latent) -> Result<QuadraticModel>) -> Result<()> {
        let trial = self.at.step(self.damping).map(|(step, fall)| (self.moved(&step), fall));
        let Some((trial, fall)) = trial.filter(|(trial, _)| is_valid(trial)) else {
            self.shorten();
            return Ok(());
        };
        let found = evaluate(&trial)?;
        let gain = self.at.value - found.value;
        if gain.is_nan() || gain <= 0.0 {
            self.shorten();
            return Ok(());
        }
        self.idle = if gain < self.progress * self.at.value { self.idle + 1 } else { 0 };
        let ratio = gain / fall;
        self.damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0);
        self.growth = 2.0;
        (self.latent, self.at) = (trial, found);
        Ok(())
    }

    fn shorten(&mut self) {
        self.damping *= self.growth;
        self.growth *= 2.0;
    }

    fn moved(&self, step: &[f64]) -> Latent {
        let mut moved = self.latent.clone();
        let (by_vectors, mut rest) = step.split_at(3 * self.at.vectors);
        for (value, step) in moved.vectors.as_flattened_mut().iter_mut().zip(by_vectors) {
            *value = (f64::from(*value) + step) as f32;
        }
        if let (true, [exposure, lobes @ ..]) = (self.at.free, rest) {
            moved.log_exposure = (f64::from(moved.log_exposure) + exposure) as f32;
            rest = lobes;
        }
        // without lobes' coordinates they stay as they are
        for (lobe, by) in moved.lobes.iter_mut().zip(rest.as_chunks().0) {
            *lobe = lobe.moved(by);
            lobe.sharpness = lobe.sharpness.clamp(self.sharpness[0], self.sharpness[1]);
        }
        moved
    }
}

/// Whether a decoder takes it.
fn is_valid(latent: &Latent) -> bool {
    latent.check_finite().is_ok() && latent.vectors.as_flattened().iter().all(|c| c.abs() <= MAX_COORDINATE)
}
