//! A start by orthogonal matching pursuit (Pati et al. 1993): lobe after lobe, each the one out of a dictionary that takes
//! most of what is left.

use super::shape;
use crate::baseline::least_squares;
use crate::baseline::target::Target;
use veni_light::sphere::reference::fibonacci_sphere;
use veni_light::vector::dot;

/// Pixels looked at, about.
const PIXELS: usize = 2048;
/// Axes of the dictionary.
const AXES: usize = 400;
/// Ratio of neighbouring sharpnesses in it.
const RATIO: f64 = 4.0;
/// Keeps amplitudes finite where two lobes are equal on the pixels looked at.
const RIDGE: f64 = 1e-8;

/// The [shapes](shape) of `count` lobes with sharpnesses between 1 and `sharpest`. Every gain is multiplied by a fresh
/// `factor`.
pub(super) fn shapes(
    target: &Target,
    count: usize,
    sharpest: f64,
    mut factor: impl FnMut() -> f64,
) -> Vec<f64> {
    // an odd stride does not stay in the same columns
    let stride = (target.weights.len() / PIXELS) | 1;
    let thin = |k: usize| k.is_multiple_of(stride);
    let pick = |values: &[[f64; 3]]| -> Vec<[f64; 3]> {
        values.iter().enumerate().filter(|(k, _)| thin(*k)).map(|(_, v)| *v).collect()
    };
    let (directions, values) = (pick(&target.directions), pick(&target.values));
    let weights: Vec<f64> = target.weights.iter().step_by(stride).copied().collect();
    let dictionary = dictionary(sharpest);
    let columns: Vec<Vec<f64>> = dictionary
        .iter()
        .map(|v| {
            directions.iter().map(|d| (v[3].exp() * (dot([v[0], v[1], v[2]], *d) - 1.0)).exp()).collect()
        })
        .collect();
    let norms: Vec<f64> =
        columns.iter().map(|e| e.iter().zip(&weights).map(|(e, w)| w * e * e).sum()).collect();
    let mut chosen: Vec<f64> = Vec::new();
    for _ in 0..count {
        let left = residual(&chosen, &directions, &weights, &values);
        let mut gain = |k: usize| {
            let sum =
                columns[k].iter().zip(&left).fold([0.0; 3], |s, (e, r)| [0, 1, 2].map(|c| s[c] + e * r[c]));
            factor() * dot(sum, sum) / norms[k]
        };
        let gains: Vec<f64> = (0..columns.len()).map(&mut gain).collect();
        let best = (0..gains.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b]));
        chosen.extend(best.map(|k| dictionary[k]).into_iter().flatten());
    }
    chosen
}

/// Evenly spread axes, each with a ladder of sharpnesses.
fn dictionary(sharpest: f64) -> Vec<[f64; 4]> {
    let steps = std::iter::successors(Some(1.0), |l| Some(l * RATIO));
    let ladder: Vec<f64> = steps.take_while(|l| *l <= sharpest.max(1.0)).collect();
    let axes = fibonacci_sphere(AXES).into_iter().map(|a| a.map(f64::from));
    axes.flat_map(|[x, y, z]| ladder.iter().map(move |l| [x, y, z, l.ln()])).collect()
}

/// ω(t − f) with the best amplitudes of the lobes so far.
fn residual(chosen: &[f64], directions: &[[f64; 3]], weights: &[f64], values: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let columns = chosen.len() / shape::FREE + 1;
    let matrix = shape::matrix(chosen, directions);
    let best = least_squares::solve(&matrix, columns, weights, values, RIDGE)
        .expect("a Gram matrix with a ridge is positive definite");
    let left = |((row, t), w): ((&[f64], &[f64; 3]), &f64)| {
        let f = row.iter().zip(&best).fold([0.0; 3], |s, (e, a)| [0, 1, 2].map(|c| s[c] + e * a[c]));
        [0, 1, 2].map(|c| w * (t[c] - f[c]))
    };
    matrix.chunks_exact(columns).zip(values).zip(weights).map(left).collect()
}
