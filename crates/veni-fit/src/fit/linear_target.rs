//! What is linear in radiance and known: harmonics of the light, what surfaces receive of it. LIGHT (17).

use veni_light::field::{Moments, NormalEquations};
use veni_light::light::LUMINANCE;
use veni_light::light::sh::pixel_integrals;
use veni_light::sphere::Equirect;

use crate::limits::{MAX_HARMONICS, MAX_SURFACES};
use crate::{Error, Result};

/// The unit of a target is free, but single precision is not: magnitudes beyond 10^±20 are refused.
const RANGE: std::ops::RangeInclusive<f64> = 1e-20..=1e20;

/// Rows that show a light well enough for a search to begin.
const COARSEST: usize = 16;

/// Integrals of light that a latent is to have, each a weighted sum of radiance over the pixels of a grid.
///
/// Directions are of the native frame, radiance is linear Rec. 709 in any unit: the latent's log exposure takes it on.
///
/// ```
/// use veni_fit::{LinearTarget, Received};
/// use veni_light::sphere::Equirect;
///
/// // a level surface in 20 000 lux, if radiance is in cd/m²
/// let target = LinearTarget::new(Equirect::new(64, 32)).surfaces(&[([0.0, 0.0, 1.0], Received::Illuminance(2e4))])?;
/// assert_eq!(target.achieved(&vec![0.0; 3 * 64 * 32]).surfaces.len(), 1);
/// # Ok::<(), veni_fit::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct LinearTarget {
    grid: Equirect,
    /// Row-major, `count` for every pixel.
    weights: Vec<f32>,
    count: usize,
    /// How many of the sums, the first ones, are harmonics; the others are surfaces.
    harmonics: usize,
    terms: Vec<Term>,
}

/// What is known of a surface that faces some way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Received {
    /// Irradiance E = ∫ L max(n·d, 0) dω, R, G and B: radiance times steradian.
    Irradiance([f64; 3]),
    /// Its luminance, 0.2126 R + 0.7152 G + 0.0722 B: lux, if radiance is in cd/m².
    Illuminance(f64),
}

/// What a light has of a target.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Achieved {
    /// The harmonics, as many as are wanted.
    pub harmonics: Vec<[f64; 3]>,
    /// The irradiance of every surface.
    pub surfaces: Vec<[f64; 3]>,
    /// √(Σ (found − wanted)²/Σ wanted²) over the harmonics, if some are wanted: the relative error of the light as far as
    /// these bands show it.
    pub harmonics_error: Option<f64>,
    /// The same over what surfaces receive.
    pub surfaces_error: Option<f64>,
}

/// (⟨mix, M_j⟩ − wanted)² · weight.
#[derive(Clone, Copy, Debug)]
struct Term {
    column: usize,
    mix: [f64; 3],
    wanted: f64,
    /// 1/Σ wanted² over the terms of a kind.
    weight: f64,
}

impl LinearTarget {
    /// Nothing yet, for a light that is decoded at the pixels of `grid`.
    pub fn new(grid: Equirect) -> Self {
        Self { grid, weights: Vec::new(), count: 0, harmonics: 0, terms: Vec::new() }
    }

    /// Also the harmonics c_lm of radiance, in the order and with the signs of [`Sh`](veni_light::light::Sh): (L + 1)² of them
    /// for some degree L.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are harmonics or surfaces already, if their number is not a square, if one is not
    /// finite, or the first one, the mean radiance, is negative or all of it 0; [`Error::TooLarge`] for more than
    /// [`MAX_HARMONICS`].
    pub fn harmonics(mut self, wanted: &[[f64; 3]]) -> Result<Self> {
        if self.count > 0 {
            return Err(Error::invalid("harmonics come first, and once"));
        }
        veni_light::limits::at_most("harmonics", wanted.len() as u64, MAX_HARMONICS as u64)?;
        let side = wanted.len().isqrt();
        if side * side != wanted.len() || side == 0 {
            let count = wanted.len();
            return Err(Error::invalid(format!(
                "{count} harmonics are of no degree; there are 1, 4, 9, 16, 25 …, (L + 1)² of degree L"
            )));
        }
        if let Some(at) = wanted.iter().position(|c| !c.iter().all(|v| v.is_finite())) {
            return Err(Error::invalid(format!(
                "harmonic {at} is {:?}; all must be finite numbers",
                wanted[at]
            )));
        }
        if wanted[0].iter().any(|v| *v < 0.0) || wanted[0] == [0.0; 3] {
            return Err(Error::invalid(format!(
                "harmonic 0 is {:?}, but it is the mean radiance times √4π: not negative, and not all 0",
                wanted[0]
            )));
        }
        let weight = Self::weight(wanted.iter().flatten())?;
        for (column, wanted) in wanted.iter().enumerate() {
            self.terms.extend(colours(column, *wanted, weight));
        }
        (self.weights, self.count, self.harmonics) =
            (pixel_integrals(self.grid, side - 1), wanted.len(), wanted.len());
        Ok(self)
    }

    /// Also what surfaces of these normals receive; the normals need not be of length 1.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are none, or some already, if a normal is 0, a number is negative or not finite, or all are
    /// 0; [`Error::TooLarge`] for more than [`MAX_SURFACES`].
    pub fn surfaces(mut self, wanted: &[([f32; 3], Received)]) -> Result<Self> {
        if self.count > self.harmonics || wanted.is_empty() {
            return Err(Error::invalid("surfaces are given once, and at least one"));
        }
        veni_light::limits::at_most("surfaces", wanted.len() as u64, MAX_SURFACES as u64)?;
        let mut normals = Vec::with_capacity(wanted.len());
        for (at, (normal, received)) in wanted.iter().enumerate() {
            let numbers = received.numbers();
            if !numbers.iter().all(|v| v.is_finite() && *v >= 0.0) {
                return Err(Error::invalid(format!(
                    "surface {at} receives {numbers:?}; light is finite and not negative"
                )));
            }
            let length = normal.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>().sqrt();
            if !(length > 0.0 && length.is_finite()) {
                return Err(Error::invalid(format!(
                    "surface {at} has the normal {normal:?}, which is not a direction"
                )));
            }
            normals.push(normal.map(|c| f64::from(c) / length));
        }
        let all: Vec<f64> = wanted.iter().flat_map(|(_, received)| received.numbers()).collect();
        let weight = Self::weight(&all)?;
        for (at, (_, received)) in wanted.iter().enumerate() {
            let column = self.count + at;
            match *received {
                Received::Irradiance(wanted) => self.terms.extend(colours(column, wanted, weight)),
                Received::Illuminance(wanted) => {
                    self.terms.push(Term { column, mix: LUMINANCE.map(f64::from), wanted, weight });
                }
            }
        }
        self.add_cosines(&normals);
        Ok(self)
    }

    /// Columns of max(n·d, 0) ω, behind those that there are.
    fn add_cosines(&mut self, normals: &[[f64; 3]]) {
        let (before, grid) = (self.count, self.grid);
        let mut all = Vec::with_capacity(grid.len() * (before + normals.len()));
        for (pixel, direction) in grid.directions().iter().enumerate() {
            all.extend(&self.weights[pixel * before..][..before]);
            let solid_angle = grid.solid_angle(pixel / grid.width);
            let on = |n: &[f64; 3]| n.iter().zip(direction).map(|(n, d)| n * f64::from(*d)).sum::<f64>();
            all.extend(normals.iter().map(|n| (solid_angle * on(n).max(0.0)) as f32));
        }
        (self.weights, self.count) = (all, before + normals.len());
    }

    fn weight<'a>(wanted: impl IntoIterator<Item = &'a f64>) -> Result<f64> {
        let scale = wanted.into_iter().map(|v| v * v).sum::<f64>().sqrt();
        if RANGE.contains(&scale) {
            return Ok(1.0 / (scale * scale));
        }
        Err(Error::invalid(match scale {
            0.0 => "all of the light is 0, and light of a latent never is".to_owned(),
            _ => format!("light of a magnitude of {scale:e} is beyond single precision; take another unit"),
        }))
    }

    /// Where the light is decoded.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// The same wanted of a light that is decoded at half the width and half the height: pixels stand for those that they cover.
    /// None of an odd number of columns or rows, or of few.
    pub fn coarser(&self) -> Option<Self> {
        let Equirect { width, height } = self.grid;
        if width % 2 + height % 2 != 0 || height <= COARSEST {
            return None;
        }
        let grid = Equirect::new(width / 2, height / 2);
        let mut weights = vec![0.0; grid.len() * self.count];
        for (pixel, own) in self.weights.chunks_exact(self.count.max(1)).enumerate() {
            let at = pixel / width / 2 * grid.width + pixel % width / 2;
            let sums = &mut weights[at * self.count..][..self.count];
            sums.iter_mut().zip(own).for_each(|(sum, w)| *sum += w);
        }
        Some(Self { grid, weights, terms: self.terms.clone(), ..*self })
    }

    /// This target and those at a half, a quarter … of its resolution, the coarsest first.
    pub(crate) fn levels(&self) -> Vec<Self> {
        let mut levels: Vec<_> = std::iter::successors(Some(self.clone()), Self::coarser).collect();
        levels.reverse();
        levels
    }

    /// Whether nothing is wanted.
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// What a light has, whose log radiance at the pixels of the grid these are, 3·W·H values.
    ///
    /// # Panics
    /// If there are more or fewer.
    pub fn achieved(&self, log_radiance: &[f32]) -> Achieved {
        let sums = self.sums(log_radiance.iter().map(|v| f64::from(*v)));
        let error = |harmonics: bool| {
            let terms = self.terms.iter().filter(|t| (t.column < self.harmonics) == harmonics);
            let of_kind: Vec<f64> = terms.map(|t| t.weight * t.residual(&sums).powi(2)).collect();
            (!of_kind.is_empty()).then(|| of_kind.iter().sum::<f64>().sqrt())
        };
        let (harmonics_error, surfaces_error) = (error(true), error(false));
        let (harmonics, surfaces) = sums.split_at(self.harmonics);
        let (harmonics, surfaces) = (harmonics.to_vec(), surfaces.to_vec());
        Achieved { harmonics, surfaces, harmonics_error, surfaces_error }
    }

    /// What is to be added to the log exposure of a light so that it fits best, in the sense of the loss: where a fit may start.
    ///
    /// # Panics
    /// As [`LinearTarget::achieved`].
    pub fn matching_exposure(&self, log_radiance: &[f32]) -> f32 {
        let sums = self.sums(log_radiance.iter().map(|v| f64::from(*v)));
        let (mut both, mut found, mut wanted) = (0.0, 0.0, 0.0);
        for term in &self.terms {
            let value = term.value(&sums);
            both += term.weight * value * term.wanted;
            found += term.weight * value * value;
            wanted += term.weight * term.wanted * term.wanted;
        }
        // light that is opposite to what is wanted gets its magnitude
        let factor = if both > 0.0 { both / found } else { (wanted / found).sqrt() };
        if factor > 0.0 && factor.is_finite() { factor.ln() as f32 } else { 0.0 }
    }

    /// The loss, and its gradient with respect to log radiance.
    pub(crate) fn with_gradient(&self, log_radiance: &[f64]) -> (f64, Vec<f64>) {
        let sums = self.sums(log_radiance.iter().copied());
        let mut by_sums = vec![[0.0; 3]; self.count];
        let mut loss = 0.0;
        for term in &self.terms {
            let residual = term.residual(&sums);
            loss += term.weight * residual * residual;
            let by = &mut by_sums[term.column];
            *by = [0, 1, 2].map(|c| by[c] + 2.0 * term.weight * residual * term.mix[c]);
        }
        let pixels = log_radiance.as_chunks::<3>().0.iter().zip(self.weights.chunks_exact(self.count.max(1)));
        let gradient = pixels.flat_map(|(pixel, weights)| {
            [0, 1, 2].map(|c| {
                let by: f64 = weights.iter().zip(&by_sums).map(|(w, by)| f64::from(*w) * by[c]).sum();
                by * pixel[c].exp()
            })
        });
        (loss, gradient.collect())
    }

    /// The loss and its Gauss–Newton model, by the moments of a field.
    pub(crate) fn equations(&self, moments: &Moments) -> NormalEquations {
        let unknowns = moments.jacobian.len() / (3 * self.count.max(1));
        let mut out = NormalEquations {
            loss: 0.0,
            gradient: vec![0.0; unknowns],
            matrix: vec![0.0; unknowns * unknowns],
        };
        for term in &self.terms {
            let residual = term.residual(&moments.values);
            let rows = &moments.jacobian[3 * term.column * unknowns..][..3 * unknowns];
            let row: Vec<f64> =
                (0..unknowns).map(|k| (0..3).map(|c| term.mix[c] * rows[c * unknowns + k]).sum()).collect();
            out.loss += term.weight * residual * residual;
            for (j, a) in row.iter().enumerate() {
                let scaled = 2.0 * term.weight * a;
                out.gradient[j] += scaled * residual;
                let line = &mut out.matrix[j * unknowns..][..unknowns];
                line.iter_mut().zip(&row).for_each(|(h, b)| *h += scaled * b);
            }
        }
        out
    }

    /// Weights of every pixel, row-major, and how many a pixel has.
    pub(crate) fn weights(&self) -> (&[f32], usize) {
        (&self.weights, self.count)
    }

    fn sums(&self, log_radiance: impl ExactSizeIterator<Item = f64>) -> Vec<[f64; 3]> {
        let values = log_radiance.len();
        assert!(values == 3 * self.grid.len(), "{values} values for {} pixels", self.grid.len());
        let mut sums = vec![[0.0; 3]; self.count];
        for (at, value) in log_radiance.enumerate() {
            let radiance = value.exp();
            let weights = &self.weights[at / 3 * self.count..][..self.count];
            sums.iter_mut().zip(weights).for_each(|(sum, w)| sum[at % 3] += f64::from(*w) * radiance);
        }
        sums
    }
}

impl Received {
    fn numbers(self) -> Vec<f64> {
        match self {
            Self::Irradiance(rgb) => rgb.to_vec(),
            Self::Illuminance(luminance) => vec![luminance],
        }
    }
}

impl Term {
    fn value(&self, sums: &[[f64; 3]]) -> f64 {
        self.mix.iter().zip(sums[self.column]).map(|(m, s)| m * s).sum()
    }

    fn residual(&self, sums: &[[f64; 3]]) -> f64 {
        self.value(sums) - self.wanted
    }
}

/// A term for every colour.
fn colours(column: usize, wanted: [f64; 3], weight: f64) -> [Term; 3] {
    [0, 1, 2].map(|c| {
        let mut mix = [0.0; 3];
        mix[c] = 1.0;
        Term { column, mix, wanted: wanted[c], weight }
    })
}
