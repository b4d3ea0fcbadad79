//! Orthogonal matching pursuit (Pati et al. 1993): lobe after lobe, each the one out of a dictionary that lowers the loss most,
//! with the best amplitudes of all that were placed. MODEL (83).

use rayon::prelude::*;
use veni_light::cholesky;
use veni_light::field::LocalQuadratic;
use veni_light::latent::Lobe;
use veni_light::sphere::reference::fibonacci_sphere;

/// Pixels looked at, about.
const PIXELS: usize = 4096;
/// Axes of the dictionary, over the whole sphere.
const AXES: usize = 800;
/// Ratio of neighbouring sharpnesses in it.
const RATIO: f32 = 3.0;
/// The widest lobe in it.
const WIDE: f32 = 1.0;
/// Keeps amplitudes finite where two lobes are equal on the pixels looked at; in parts of the weights' sum.
const RIDGE: f64 = 1e-6;

/// The lobes that may be placed, on the pixels that are looked at.
pub(super) struct Pursuit {
    /// Every how many pixels one is looked at; odd, so that it does not stay in the same columns.
    stride: usize,
    dictionary: Vec<Lobe>,
    /// A row for each lobe: its values where the amplitude is 1.
    values: Vec<f32>,
    /// Pixels looked at.
    pixels: usize,
}

impl Pursuit {
    /// Lobes no sharper than the larger of `sharpness`, on pixels in these directions.
    pub(super) fn new(directions: &[[f32; 3]], sharpness: [f32; 2]) -> Self {
        let stride = (directions.len() / PIXELS) | 1;
        let seen: Vec<[f32; 3]> = directions.iter().step_by(stride).copied().collect();
        let ladder = std::iter::successors(Some(WIDE.max(sharpness[0])), |s| Some(s * RATIO));
        let ladder: Vec<f32> = ladder.take_while(|s| *s <= sharpness[1].max(WIDE)).collect();
        let lobe =
            |direction| ladder.iter().map(move |s| Lobe { direction, amplitude: [1.0; 3], sharpness: *s });
        let dictionary: Vec<Lobe> = fibonacci_sphere(AXES).into_iter().flat_map(lobe).collect();
        let mut values = vec![0.0; dictionary.len() * seen.len()];
        values.par_chunks_exact_mut(seen.len()).zip(&dictionary).for_each(|(row, lobe)| {
            row.iter_mut().zip(&seen).for_each(|(value, d)| *value = lobe.value(*d)[0]);
        });
        Self { stride, dictionary, values, pixels: seen.len() }
    }

    /// `count` lobes that lower the losses, which `local` gives for every pixel, by most.
    pub(super) fn place(&self, local: &[LocalQuadratic], count: usize) -> Vec<Lobe> {
        let seen: Vec<&LocalQuadratic> = local.iter().step_by(self.stride).collect();
        let weights: [Vec<f64>; 3] = [0, 1, 2].map(|c| seen.iter().map(|l| f64::from(l.weight[c])).collect());
        let total: f64 = weights.iter().flatten().sum();
        let squares = self.of_all(|row| products(row, &weights, true));
        let mut chosen = Vec::new();
        let mut amplitudes: Vec<[f64; 3]> = Vec::new();
        for _ in 0..count {
            // with what was placed so far
            let mut gradient: [Vec<f64>; 3] =
                [0, 1, 2].map(|c| seen.iter().map(|l| f64::from(l.gradient[c])).collect());
            for (k, a) in chosen.iter().zip(&amplitudes) {
                for (c, gradient) in gradient.iter_mut().enumerate() {
                    let added = self.row(*k).iter().zip(&weights[c]).map(|(e, w)| f64::from(*e) * w * a[c]);
                    gradient.iter_mut().zip(added).for_each(|(g, by)| *g += by);
                }
            }
            let Some(best) = self.best(&gradient, &squares, RIDGE * total) else { break };
            chosen.push(best);
            amplitudes = self.amplitudes(&chosen, &seen, RIDGE * total);
        }
        let lobe = |(k, a): (usize, [f64; 3])| Lobe { amplitude: a.map(|v| v as f32), ..self.dictionary[k] };
        chosen.into_iter().zip(amplitudes).map(lobe).collect()
    }

    fn row(&self, k: usize) -> &[f32] {
        &self.values[k * self.pixels..][..self.pixels]
    }

    /// What `of` says of each row, on all threads.
    fn of_all<T: Send>(&self, of: impl Fn(&[f32]) -> T + Sync + Send) -> Vec<T> {
        self.values.par_chunks_exact(self.pixels).map(of).collect()
    }

    /// The lobe that alone lowers the loss most: by Σ_c ½ (eᵀ∇_c)²/(eᵀ diag(w_c) e), with the loss's gradient ∇ with respect to
    /// log radiance.
    fn best(&self, gradient: &[Vec<f64>; 3], squares: &[[f64; 3]], ridge: f64) -> Option<usize> {
        let along = self.of_all(|row| products(row, gradient, false));
        let gain = |(along, square): (&[f64; 3], &[f64; 3])| -> f64 {
            along.iter().zip(square).map(|(along, square)| along * along / (square + ridge)).sum()
        };
        let gains: Vec<f64> = along.iter().zip(squares).map(gain).collect();
        (0..gains.len()).filter(|k| gains[*k] > 0.0).max_by(|a, b| gains[*a].total_cmp(&gains[*b]))
    }

    /// The amplitudes of the chosen lobes at which the parabola of the losses is least, channel by channel.
    fn amplitudes(&self, chosen: &[usize], seen: &[&LocalQuadratic], ridge: f64) -> Vec<[f64; 3]> {
        let n = chosen.len();
        let mut out = vec![[0.0; 3]; n];
        for c in 0..3 {
            let mut matrix = vec![0.0; n * n];
            let mut right = vec![[0.0f64; 1]; n];
            for (p, local) in seen.iter().enumerate() {
                let (weight, gradient) = (f64::from(local.weight[c]), f64::from(local.gradient[c]));
                if weight == 0.0 {
                    continue;
                }
                for (i, k) in chosen.iter().enumerate() {
                    let e = f64::from(self.row(*k)[p]);
                    right[i][0] -= e * gradient;
                    for (j, other) in chosen[..=i].iter().enumerate() {
                        matrix[i * n + j] += weight * e * f64::from(self.row(*other)[p]);
                    }
                }
            }
            (0..n).for_each(|i| matrix[i * (n + 1)] += ridge);
            cholesky::factor(&mut matrix, n).expect("a Gram matrix with a ridge is positive definite");
            cholesky::substitute(&matrix, n, &mut right);
            out.iter_mut().zip(right).for_each(|(a, [v])| a[c] = v);
        }
        out
    }
}

/// Σ e v of a row's values e with each of three columns v; of their squares, Σ e² v, where they are `squared`.
fn products(row: &[f32], columns: &[Vec<f64>; 3], squared: bool) -> [f64; 3] {
    /// Sums that run side by side, so that they fill vectors.
    const LANES: usize = 16;
    pulp::Arch::new().dispatch(|| {
        let (rows, rest) = row.as_chunks::<LANES>();
        let power = |e: f32| f64::from(if squared { e * e } else { e });
        [0, 1, 2].map(|c| {
            let (column, beyond) = columns[c].as_chunks::<LANES>();
            let mut sums = [0.0; LANES];
            for (row, column) in rows.iter().zip(column) {
                for ((sum, e), v) in sums.iter_mut().zip(row).zip(column) {
                    *sum += power(*e) * v;
                }
            }
            let rest: f64 = rest.iter().zip(beyond).map(|(e, v)| power(*e) * v).sum();
            sums.iter().sum::<f64>() + rest
        })
    })
}
