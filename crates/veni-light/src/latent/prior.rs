//! A Gaussian over latent codes that does not prefer a compass direction. MODEL (35).
//!
//! With c = x + iy for the N vectors, a distribution that is invariant under rotation about z has E c = 0,
//! E c cᵀ = 0 and no correlation between c and z. What remains is the Hermitian covariance C = E c cᴴ (how
//! vectors rotate and stretch together) and mean and covariance Σ of z. A sample is c = L w, z = μ + K g, with
//! C = L Lᴴ, Σ = K Kᵀ, w circular complex normal (E|w|² = 1) and g standard normal.

use super::Latent;
use super::draw::{Draw, SunDraw};
#[cfg(feature = "gradients")]
use super::step::Row;
use super::sun::SunPrior;
use crate::cholesky::{self, Complex, Scalar};
use crate::compact::{CompactLight, Lights};
use crate::random::Stream;
use crate::{Error, Result};

/// A rotation-invariant Gaussian of N latent vectors, a normal log exposure, and what is known of the sun given the vectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Row-major lower triangles, [N, N].
    pub(crate) xy_real: Vec<f32>,
    pub(crate) xy_imaginary: Vec<f32>,
    pub(crate) z: Vec<f32>,
    pub(crate) z_mean: Vec<f32>,
    /// Mean and standard deviation.
    pub(crate) log_exposure: [f32; 2],
    pub(crate) sun: Option<SunPrior>,
}

impl Prior {
    /// Every coordinate standard normal, exposure 0: the prior that training assumes.
    pub fn standard(latent_vectors: usize) -> Self {
        let n = latent_vectors;
        let diagonal = |value: f32| (0..n * n).map(|i| if i % (n + 1) == 0 { value } else { 0.0 }).collect();
        Self {
            xy_real: diagonal(std::f32::consts::SQRT_2), // E|c|² = 2
            xy_imaginary: vec![0.0; n * n],
            z: diagonal(1.0),
            z_mean: vec![0.0; n],
            log_exposure: [0.0; 2],
            sun: None,
        }
    }

    /// N, the number of vectors.
    pub fn latent_vectors(&self) -> usize {
        self.z_mean.len()
    }

    /// Mean and standard deviation of the log exposure.
    pub fn log_exposure(&self) -> [f32; 2] {
        self.log_exposure
    }

    /// Fits the codes of a training set.
    ///
    /// `variances`, if given, holds for each code the N posterior variances (per coordinate); their means are
    /// added to the diagonals, so that samples fill the posterior's width too. Since a set is often smaller
    /// than N, both covariances are shrunk towards a multiple of the identity by the factor of Ledoit and
    /// Wolf (2004), which is estimated from the codes, and no direction has less than a millionth of the mean
    /// variance.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are fewer than two codes, their N differ, a number is not finite, or
    /// `variances` does not match; if a covariance spans more orders of magnitude than f64 can factor.
    pub fn fit(codes: &[Latent], variances: Option<&[Vec<f32>]>) -> Result<Self> {
        if codes.len() < 2 {
            return Err(Error::invalid(format!("a prior needs at least two codes, got {}", codes.len())));
        }
        let (n, count) = (codes[0].vectors.len(), codes.len() as f64);
        for code in codes {
            code.check_finite()?;
            if n == 0 || code.vectors.len() != n {
                let m = code.vectors.len();
                return Err(Error::invalid(format!(
                    "a prior needs codes of one size, got {n} and {m} vectors"
                )));
            }
        }
        let noise = mean_variances(codes.len(), n, variances)?;
        let mean = |value: &dyn Fn(&Latent) -> f64| codes.iter().map(value).sum::<f64>() / count;
        let z_mean: Vec<f64> = (0..n).map(|i| mean(&|code| f64::from(code.vectors[i][2]))).collect();
        let exposure = mean(&|code| f64::from(code.log_exposure));
        let spread = mean(&|code| (f64::from(code.log_exposure) - exposure).powi(2)).sqrt();
        let samples = |part: &dyn Fn(usize, [f32; 3]) -> Complex| -> Vec<Vec<Complex>> {
            let vectors = |code: &Latent| code.vectors.iter().enumerate().map(|(i, v)| part(i, *v)).collect();
            codes.iter().map(vectors).collect()
        };
        let xy = samples(&|_, [x, y, _]| [f64::from(x), f64::from(y)]);
        let z = samples(&|i, v| [f64::from(v[2]) - z_mean[i], 0.0]);
        // one variance per coordinate, and c has two of them
        let xy = factored(shrunk_covariance(&xy, &noise, 2.0), n, [0.0; 2])?;
        let z = shrunk_covariance(&z, &noise, 1.0).into_iter().map(|[real, _]| real).collect();
        let z: Vec<f64> = factored(z, n, 0.0)?;
        let part = |k: usize| xy.iter().map(|c| c[k] as f32).collect();
        Ok(Self {
            xy_real: part(0),
            xy_imaginary: part(1),
            z: z.iter().map(|v| *v as f32).collect(),
            z_mean: z_mean.iter().map(|v| *v as f32).collect(),
            log_exposure: [exposure as f32, spread as f32],
            sun: None,
        })
    }

    /// The same with a density of the sun given the vectors, learned from the suns of `codes`; without one if fewer than eight of them
    /// have a sun.
    ///
    /// # Panics
    /// If a code does not have N vectors.
    #[must_use]
    pub fn with_suns_of(self, codes: &[Latent]) -> Self {
        let whitened: Vec<_> = codes.iter().map(|code| self.whitened(&code.vectors)).collect();
        let suns: Vec<_> = codes.iter().map(|code| code.lights.sun().copied()).collect();
        Self { sun: SunPrior::fit(&whitened, &suns), ..self }
    }

    /// The density of the sun given the vectors, if one was fitted: random skies then have suns.
    pub fn sun(&self) -> Option<&SunPrior> {
        self.sun.as_ref()
    }

    /// How likely it is that the sky of these vectors has a sun, in [0, 1], and the most likely one; None where nothing is known of
    /// suns.
    ///
    /// # Panics
    /// If there are not N vectors.
    pub fn likely_sun(&self, vectors: &[[f32; 3]]) -> Option<(f64, CompactLight)> {
        let sun = self.sun.as_ref()?;
        let (w, g) = self.whitened(vectors);
        Some(sun.likely(&Draw { w, g, exposure: 0.0, sun: SunDraw::default() }))
    }

    /// Draws a code; see [`Latent::sample`].
    pub(super) fn sample(&self, rng: &mut Stream) -> Latent {
        self.code(&self.draw(rng))
    }

    /// The random numbers of a code.
    pub(crate) fn draw(&self, rng: &mut Stream) -> Draw {
        let n = self.latent_vectors();
        let w = (0..n).map(|_| rng.normals().map(|g| g * std::f64::consts::FRAC_1_SQRT_2)).collect();
        let g = (0..n.div_ceil(2)).flat_map(|_| rng.normals()).collect();
        let [exposure, _] = rng.normals();
        // the last, so that vectors and exposure of a seed are those of a prior without suns
        let sun = if self.sun.is_some() { SunDraw::new(rng) } else { SunDraw::default() };
        Draw { w, g, exposure, sun }
    }

    /// The code of a draw.
    pub(crate) fn code(&self, draw: &Draw) -> Latent {
        let Draw { w, g, exposure, .. } = draw;
        let n = self.latent_vectors();
        let vector = |i: usize| {
            let mut v = [0.0, 0.0, f64::from(self.z_mean[i])];
            for j in 0..=i {
                let at = i * n + j;
                let (re, im) = (f64::from(self.xy_real[at]), f64::from(self.xy_imaginary[at]));
                v[0] += re * w[j][0] - im * w[j][1];
                v[1] += re * w[j][1] + im * w[j][0];
                v[2] += f64::from(self.z[at]) * g[j];
            }
            v.map(|c| c as f32)
        };
        let [mean, deviation] = self.log_exposure.map(f64::from);
        Latent {
            vectors: (0..n).map(vector).collect(),
            lights: Lights::new(self.sun.as_ref().and_then(|sun| sun.sun(draw)), []),
            log_exposure: (mean + deviation * exposure) as f32,
            ..Latent::default()
        }
    }

    /// The derivative with respect to the numbers of a draw of what has this gradient with respect to the vectors: Lᴴ(∂x + i∂y), Kᵀ∂z.
    #[cfg(feature = "gradients")]
    pub(crate) fn row(&self, gradient: &[[f32; 3]]) -> Row {
        let n = self.latent_vectors();
        let (xy, z) = self.factors();
        let mut row = Row { w: vec![[0.0; 2]; n], g: vec![0.0; n], ..Row::zero() };
        for (i, by) in gradient.iter().enumerate() {
            let [x, y, by_z] = by.map(f64::from);
            for j in 0..=i {
                let [re, im] = xy[i * n + j];
                let sum = &mut row.w[j];
                *sum = [sum[0] + re * x + im * y, sum[1] + re * y - im * x];
                row.g[j] += z[i * n + j] * by_z;
            }
        }
        row
    }

    /// L⁻¹c and K⁻¹(z − μ) of a code's vectors.
    ///
    /// # Panics
    /// If there are not N vectors.
    pub(super) fn whitened(&self, vectors: &[[f32; 3]]) -> (Vec<Complex>, Vec<f64>) {
        let (mut c, mut z) = self.centred(vectors);
        let (xy, factor) = self.factors();
        let n = self.latent_vectors();
        cholesky::forward(&xy, n, &mut c);
        cholesky::forward(&factor, n, &mut z);
        (c.into_iter().flatten().collect(), z.into_iter().flatten().collect())
    }

    /// c and z − μ, as right sides of systems of equations.
    pub(super) fn centred(&self, vectors: &[[f32; 3]]) -> (Vec<[Complex; 1]>, Vec<[f64; 1]>) {
        let n = self.latent_vectors();
        assert_eq!(vectors.len(), n, "a prior of {n} vectors");
        let c = vectors.iter().map(|v| [[f64::from(v[0]), f64::from(v[1])]]).collect();
        let z = vectors.iter().zip(&self.z_mean).map(|(v, m)| [f64::from(v[2]) - f64::from(*m)]).collect();
        (c, z)
    }

    /// L and K.
    pub(crate) fn factors(&self) -> (Vec<Complex>, Vec<f64>) {
        let parts = self.xy_real.iter().zip(&self.xy_imaginary);
        (
            parts.map(|(re, im)| [f64::from(*re), f64::from(*im)]).collect(),
            self.z.iter().copied().map(f64::from).collect(),
        )
    }
}

fn mean_variances(codes: usize, n: usize, variances: Option<&[Vec<f32>]>) -> Result<Vec<f64>> {
    let mut mean = vec![0.0; n];
    let Some(variances) = variances else { return Ok(mean) };
    if variances.len() != codes || variances.iter().any(|v| v.len() != n) {
        return Err(Error::invalid(format!("a prior of {codes} codes needs {codes} × {n} variances")));
    }
    for (i, value) in variances.iter().flat_map(|v| v.iter().enumerate()) {
        if !(value.is_finite() && *value >= 0.0) {
            return Err(Error::invalid(format!("a posterior variance is {value}")));
        }
        mean[i] += f64::from(*value) / codes as f64;
    }
    Ok(mean)
}

/// (1 − ρ) S + ρ m I + k·diag(noise) of centred samples, S = mean of x xᴴ, m = tr S / N, row-major.
///
/// ρ = min(1, b²/d²) with d² = ‖S − m I‖² and b² = (1/n²) Σ ‖x xᴴ − S‖² = (Σ ‖x‖⁴/n − ‖S‖²)/n.
fn shrunk_covariance(samples: &[Vec<Complex>], noise: &[f64], k: f64) -> Vec<Complex> {
    let (n, count) = (noise.len(), samples.len() as f64);
    let mut s = vec![[0.0; 2]; n * n];
    let mut fourth = 0.0;
    for x in samples {
        for (i, [a, b]) in x.iter().enumerate() {
            for (j, [c, d]) in x.iter().enumerate() {
                let sum = &mut s[i * n + j];
                *sum = [sum[0] + (a * c + b * d) / count, sum[1] + (b * c - a * d) / count];
            }
        }
        fourth += x.iter().map(|[a, b]| a * a + b * b).sum::<f64>().powi(2) / count;
    }
    let mean = (0..n).map(|i| s[i * n + i][0]).sum::<f64>() / n as f64;
    let norm: f64 = s.iter().map(|[a, b]| a * a + b * b).sum();
    let (distance, error) = (norm - n as f64 * mean * mean, (fourth - norm) / count);
    let shrink = if distance > 0.0 { (error / distance).clamp(0.0, 1.0) } else { 1.0 };
    for value in s.as_flattened_mut() {
        *value *= 1.0 - shrink;
    }
    // the absolute part keeps a set of identical codes factorable
    let floor = (1e-6 * mean).max(1e-12);
    for i in 0..n {
        s[i * n + i][0] += shrink * mean + k * noise[i] + floor;
    }
    s
}

/// Lower triangle L with L Lᴴ = the given matrix; zeros above.
fn factored<T: Scalar>(mut a: Vec<T>, n: usize, zero: T) -> Result<Vec<T>> {
    cholesky::factor(&mut a, n)
        .ok_or_else(|| Error::invalid("the codes' covariance is not positive definite"))?;
    for i in 0..n {
        a[i * n + i + 1..(i + 1) * n].fill(zero);
    }
    Ok(a)
}

#[cfg(test)]
mod tests;
