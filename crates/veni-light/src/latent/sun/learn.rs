//! Fitting the density of the sun to codes whose suns are known. MODEL (74).

use super::{
    COLOUR, ELEVATION, LOGIT_TO_PROBIT, LUMINANCE, MEASURES, RADIUS, SunPrior, WIDEST, colour,
    elevation_measure,
};
use crate::cholesky::{self, Complex};
use crate::compact::CompactLight;

/// Penalties that are tried, as shares of the number of samples; the whitened coordinates have variance 1.
const PENALTIES: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
/// Fewest suns that anything is learned from.
const FEWEST: usize = 8;
/// Parts of the cross-validation of the presence.
const PARTS: usize = 5;

/// w and g of a code.
type Whitened = (Vec<Complex>, Vec<f64>);

impl SunPrior {
    /// Learns how suns depend on the vectors of their codes, given in whitened coordinates w and g: ridge regressions whose
    /// penalties have the least error on samples left out, with the errors of samples left out as the noise. Suns below the
    /// horizon, wider than 6° or without one of the colours count as none.
    ///
    /// None if fewer than eight codes have a sun.
    ///
    /// # Panics
    /// If there are not as many suns as codes.
    pub(in crate::latent) fn fit(whitened: &[Whitened], suns: &[Option<CompactLight>]) -> Option<Self> {
        assert_eq!(whitened.len(), suns.len(), "a sun, or none, of each code");
        let n = whitened.first()?.1.len();
        let suns: Vec<_> = suns.iter().map(|sun| sun.as_ref().and_then(Measured::new)).collect();
        let with = || whitened.iter().zip(&suns).filter_map(|((w, g), sun)| Some((w, g, sun.as_ref()?)));
        let count = with().count();
        if count < FEWEST {
            return None;
        }
        let w: Vec<_> = with().map(|(w, ..)| w.clone()).collect();
        let headings: Vec<_> = with().map(|(.., sun)| sun.heading).collect();
        let azimuth = Ridge::best(&w, &headings, false)?;

        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / count as f64;
        let g_mean: Vec<f64> = (0..n).map(|i| mean(&mut with().map(|(_, g, _)| g[i]))).collect();
        let centred: Vec<Vec<Complex>> =
            with().map(|(_, g, _)| g.iter().zip(&g_mean).map(|(g, m)| [g - m, 0.0]).collect()).collect();
        let t_mean: [f64; MEASURES] = std::array::from_fn(|k| mean(&mut with().map(|(.., sun)| sun.t[k])));
        let mut rows = Vec::with_capacity(MEASURES);
        for (k, t_mean) in t_mean.into_iter().enumerate() {
            let targets: Vec<Complex> = with().map(|(.., sun)| [sun.t[k] - t_mean, 0.0]).collect();
            rows.push(Ridge::best(&centred, &targets, true)?);
        }
        let mut noise: Vec<f64> = (0..MEASURES * MEASURES)
            .map(|at| {
                let (a, b) = (&rows[at / MEASURES].residuals, &rows[at % MEASURES].residuals);
                // equal measures leave no noise; the floor keeps the matrix positive
                let floor = if at / MEASURES == at % MEASURES { 1e-6 } else { 0.0 };
                mean(&mut a.iter().zip(b).map(|(a, b)| a[0] * b[0])) + floor
            })
            .collect();
        cholesky::factor(&mut noise, MEASURES)?;
        let weights = |row: &Ridge| row.weights.iter().map(|[re, _]| *re).collect::<Vec<_>>();
        let bias = |k: usize| t_mean[k] - product(&weights(&rows[k]), &g_mean);
        let g: Vec<_> = whitened.iter().map(|(_, g)| g.clone()).collect();
        let present: Vec<_> = suns.iter().map(Option::is_some).collect();
        Some(Self {
            azimuth: azimuth.weights.iter().map(|a| a.map(|v| v as f32)).collect(),
            azimuth_noise: azimuth.error().sqrt() as f32,
            weights: rows.iter().flat_map(weights).map(|v| v as f32).collect(),
            mean: std::array::from_fn(|k| bias(k) as f32),
            noise: std::array::from_fn(|i| {
                std::array::from_fn(|j| if j > i { 0.0 } else { noise[i * MEASURES + j] as f32 })
            }),
            presence: presence(&g, &present).into_iter().map(|v| (v / LOGIT_TO_PROBIT) as f32).collect(),
        })
    }
}

/// A sun in the units of the density.
struct Measured {
    heading: Complex,
    t: [f64; MEASURES],
}

impl Measured {
    fn new(sun: &CompactLight) -> Option<Self> {
        let [x, y, sine] = sun.direction.map(f64::from);
        let flat = x.hypot(y);
        let (luminance, ratios) = colour(sun.irradiance)?;
        let is_one = sun.radius > 0.0 && f64::from(sun.radius) <= WIDEST;
        if !(is_one && sine > 0.0 && sine < 1.0 && flat > 0.0) {
            return None;
        }
        let mut t = [0.0; MEASURES];
        t[ELEVATION] = elevation_measure(sine);
        t[LUMINANCE] = luminance.ln();
        COLOUR.iter().zip(ratios).for_each(|(at, ratio)| t[*at] = ratio.ln());
        t[RADIUS] = f64::from(sun.radius).ln();
        Some(Self { heading: [x / flat, y / flat], t })
    }
}

/// A penalised linear regression.
struct Ridge {
    weights: Vec<Complex>,
    /// Of each sample, predicted by the regression of the others.
    residuals: Vec<Complex>,
}

impl Ridge {
    /// The one of [`PENALTIES`] with the least error on samples left out. `centred`: the samples' mean was subtracted.
    fn best(features: &[Vec<Complex>], targets: &[Complex], centred: bool) -> Option<Self> {
        let fit = |share| Self::new(features, targets, share * targets.len() as f64, centred);
        PENALTIES.into_iter().filter_map(fit).min_by(|a, b| a.error().total_cmp(&b.error()))
    }

    /// Minimises Σ |y − ⟨a, x⟩|² + λ|a|². The residual of a sample left out is its own over 1 − h, h = xᴴ(XᴴX + λ)⁻¹x, and
    /// 1/n more where a mean was subtracted.
    fn new(features: &[Vec<Complex>], targets: &[Complex], penalty: f64, centred: bool) -> Option<Self> {
        let n = features.first()?.len();
        let mut gram = vec![[0.0; 2]; n * n];
        let mut right = vec![[[0.0; 2]; 1]; n];
        for (x, [s, t]) in features.iter().zip(targets) {
            for (i, [a, b]) in x.iter().enumerate() {
                for (j, [c, d]) in x[..=i].iter().enumerate() {
                    let sum = &mut gram[i * n + j];
                    *sum = [sum[0] + a * c + b * d, sum[1] + a * d - b * c];
                }
                let [sum] = &mut right[i];
                *sum = [sum[0] + a * s + b * t, sum[1] + a * t - b * s];
            }
        }
        (0..n).for_each(|i| gram[i * n + i][0] += penalty);
        cholesky::factor(&mut gram, n)?;
        cholesky::substitute(&gram, n, &mut right);
        let weights: Vec<Complex> = right.into_iter().map(|[w]| w).collect();
        let mean = if centred { 1.0 / targets.len() as f64 } else { 0.0 };
        let residual = |x: &Vec<Complex>, [s, t]: Complex| {
            let mut conjugate: Vec<[Complex; 1]> = x.iter().map(|[a, b]| [[*a, -b]]).collect();
            cholesky::forward(&gram, n, &mut conjugate);
            let leverage = mean + conjugate.iter().map(|[[a, b]]| a * a + b * b).sum::<f64>();
            let [re, im] = x
                .iter()
                .zip(&weights)
                .fold([0.0; 2], |[re, im], ([a, b], [c, d])| [re + a * c - b * d, im + a * d + b * c]);
            [s - re, t - im].map(|v| v / (1.0 - leverage))
        };
        let residuals = features.iter().zip(targets).map(|(x, y)| residual(x, *y)).collect();
        Some(Self { weights, residuals })
    }

    /// Mean square of the residuals.
    fn error(&self) -> f64 {
        self.residuals.iter().map(|[a, b]| a * a + b * b).sum::<f64>() / self.residuals.len() as f64
    }
}

/// Weights and bias of a logistic regression whose penalty is the best of a cross-validation; the bias alone where nothing
/// better is found, or all or none are present.
fn presence(features: &[Vec<f64>], present: &[bool]) -> Vec<f64> {
    let n = features.first().map_or(0, Vec::len);
    let (count, with) = (present.len() as f64, present.iter().filter(|p| **p).count() as f64);
    let alone = || {
        // the rule of succession: not even where all have one is it certain
        let odds = (with + 1.0) / (count - with + 1.0);
        [vec![0.0; n], vec![odds.ln()]].concat()
    };
    if with == 0.0 || with == count {
        return alone();
    }
    let part = |k: usize, inside: bool| {
        let chosen = (0..present.len()).filter(move |i| (i % PARTS == k) == inside);
        chosen.map(|i| (features[i].as_slice(), present[i]))
    };
    let loss = |weights: &[f64], samples: &mut dyn Iterator<Item = (&[f64], bool)>| {
        let one = |(x, y): (&[f64], bool)| {
            let margin = (product(x, weights) + weights[n]) * if y { 1.0 } else { -1.0 };
            (-margin).max(0.0) + (-margin.abs()).exp().ln_1p()
        };
        samples.map(one).sum::<f64>()
    };
    let validated = |share: f64| {
        (0..PARTS)
            .map(|k| loss(&logistic(&part(k, false).collect::<Vec<_>>(), n, share), &mut part(k, true)))
            .sum::<f64>()
    };
    let (best, share) = PENALTIES
        .iter()
        .map(|share| (validated(*share), *share))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((f64::INFINITY, 1.0));
    let base: f64 =
        [(with, with / count), (count - with, 1.0 - with / count)].iter().map(|(k, p)| -k * p.ln()).sum();
    if best >= base {
        return alone();
    }
    let all: Vec<_> = features.iter().map(Vec::as_slice).zip(present.iter().copied()).collect();
    logistic(&all, n, share)
}

/// Newton's method on the penalised likelihood, the bias free.
fn logistic(samples: &[(&[f64], bool)], n: usize, share: f64) -> Vec<f64> {
    const STEPS: usize = 20;
    let (size, penalty) = (n + 1, share * samples.len() as f64 / 4.0);
    let mut weights = vec![0.0; size];
    for _ in 0..STEPS {
        let mut hessian = vec![0.0; size * size];
        let mut gradient = vec![[0.0]; size];
        for (x, y) in samples {
            let p = 1.0 / (1.0 + (-product(x, &weights) - weights[n]).exp());
            let value = |i: usize| if i < n { x[i] } else { 1.0 };
            for i in 0..size {
                gradient[i][0] += value(i) * (f64::from(u8::from(*y)) - p);
                for j in 0..=i {
                    hessian[i * size + j] += p * (1.0 - p) * value(i) * value(j);
                }
            }
        }
        for i in 0..n {
            gradient[i][0] -= penalty * weights[i];
            hessian[i * size + i] += penalty;
        }
        // a bias without curvature: all samples of one kind
        hessian[size * size - 1] += 1e-6;
        if cholesky::factor(&mut hessian, size).is_none() {
            break;
        }
        cholesky::substitute(&hessian, size, &mut gradient);
        weights.iter_mut().zip(&gradient).for_each(|(w, [step])| *w += step);
    }
    weights
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
