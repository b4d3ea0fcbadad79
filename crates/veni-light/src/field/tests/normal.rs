//! The normal equations against differences of the plain f64 network.

use super::reference::Plain;
use super::*;
use crate::field::{LocalQuadratic, NormalEquations};
use crate::latent::{Latent, Prior};

/// Σ w (p − t)² with weights and targets of every channel its own; every third direction counts nothing.
fn loss(i: usize, p: [f32; 3]) -> LocalQuadratic {
    let weight = [0, 1, 2].map(|c| if i % 3 == 2 { 0.0 } else { 0.5 + ((i + 2 * c) % 7) as f32 });
    let error = [0, 1, 2].map(|c| p[c] - 0.3 * c as f32 + (i % 5) as f32 * 0.2);
    LocalQuadratic {
        loss: (0..3).map(|c| f64::from(weight[c] * error[c] * error[c])).sum(),
        gradient: [0, 1, 2].map(|c| 2.0 * weight[c] * error[c]),
        weight: weight.map(|w| 2.0 * w),
    }
}

fn found(model: &Model, latent: &Latent, directions: &[[f32; 3]]) -> NormalEquations {
    model.decoder().unwrap().condition(latent).unwrap().normal_equations(directions, loss)
}

/// ∂P/∂(latent) in a direction by central differences of the plain network, exposure last; nothing where a difference crosses
/// the kink of a ReLU.
pub(super) fn jacobian(plain: &Plain<'_>, latent: &Latent, d: [f32; 3]) -> Option<Vec<[f64; 3]>> {
    let moved = |k: usize, step: f32| {
        let mut moved = latent.clone();
        let at = match moved.vectors.as_flattened_mut().get_mut(k) {
            Some(c) => c,
            None => &mut moved.log_exposure,
        };
        *at += step;
        let at = f64::from(*at);
        (moved, at)
    };
    let middle = plain.log_radiance(latent, d);
    let row = |k: usize| {
        // f32 latents resolve it
        let ((high, up), (_, at), (low, down)) =
            (moved(k, 1.0 / 65536.0), moved(k, 0.0), moved(k, -1.0 / 65536.0));
        let (high, low) = (plain.log_radiance(&high, d), plain.log_radiance(&low, d));
        let after = [0, 1, 2].map(|c| (high[c] - middle[c]) / (up - at));
        let before = [0, 1, 2].map(|c| (middle[c] - low[c]) / (at - down));
        let smooth = (0..3).all(|c| (after[c] - before[c]).abs() < 1e-3 + 1e-2 * before[c].abs());
        smooth.then(|| [0, 1, 2].map(|c| 0.5 * (after[c] + before[c])))
    };
    (0..=3 * latent.vectors.len()).map(row).collect()
}

/// Jᵀ diag(ℓ″) J with J by [`jacobian`], row-major; and the directions it is of, those of `directions` that have them.
fn expected(model: &Model, latent: &Latent, directions: &[[f32; 3]]) -> (Vec<[f32; 3]>, Vec<f64>) {
    let (plain, unknowns) = (Plain(model), 3 * latent.vectors.len() + 1);
    let (mut kept, mut matrix) = (Vec::new(), vec![0.0; unknowns * unknowns]);
    for d in directions {
        let Some(rows) = jacobian(&plain, latent, *d) else { continue };
        let weight = loss(kept.len(), [0.0; 3]).weight.map(f64::from);
        kept.push(*d);
        for (j, a) in rows.iter().enumerate() {
            for (k, b) in rows.iter().enumerate() {
                matrix[j * unknowns + k] += (0..3).map(|c| weight[c] * a[c] * b[c]).sum::<f64>();
            }
        }
    }
    assert!(2 * kept.len() > directions.len(), "{} of {} directions", kept.len(), directions.len());
    (kept, matrix)
}

/// The largest difference, in parts of the largest entry.
pub(super) fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale
}

pub(super) fn at(n: usize) -> Latent {
    Latent { log_exposure: 0.25, ..Latent::from_seed(&Prior::standard(n), 3) }
}

#[test]
fn differences_of_the_plain_network_agree() {
    let agrees = |model: &Model, n: usize, count: usize| {
        let (directions, expected) = expected(model, &at(n), &directions(count));
        let error = apart(&found(model, &at(n), &directions).matrix, &expected);
        assert!(error < 3e-4, "{n} vectors, {} directions: {error}", directions.len());
    };
    for form in [VnReluForm::Projection, VnReluForm::Reference] {
        // sizes that fill no register, and more inputs than one chunk takes
        agrees(&odd(2, 13, form), 2, 131);
        agrees(&odd(30, 16, form), 30, 131);
    }
    // the paper's size
    agrees(&filler(9), 9, 60);
}

#[test]
fn the_gradient_is_that_of_the_other_kernel_and_a_wrong_matrix_is_seen() {
    let (model, directions) = (odd(3, 16, VnReluForm::Projection), directions(700));
    let equations = found(&model, &at(3), &directions);
    let field = model.decoder().unwrap().condition(&at(3)).unwrap();
    let gradient = field.gradient(&directions, |i, p| {
        let LocalQuadratic { loss, gradient, .. } = loss(i, p);
        (loss, gradient)
    });
    let flat = gradient.vectors.as_flattened().iter().chain([&gradient.log_exposure]);
    let flat: Vec<f64> = flat.map(|g| f64::from(*g)).collect();
    assert!(apart(&equations.gradient, &flat) < 1e-5);
    assert!((equations.loss - gradient.loss).abs() < 1e-6 * gradient.loss);
    // symmetric, and not what it is at another latent or with a sign changed
    let unknowns = flat.len();
    let transposed: Vec<f64> =
        (0..unknowns * unknowns).map(|k| equations.matrix[k % unknowns * unknowns + k / unknowns]).collect();
    assert!(apart(&equations.matrix, &transposed) < 1e-5);
    let (few, truth) = expected(&model, &at(3), &directions[..70]);
    let mut wrong = found(&model, &at(3), &few).matrix;
    assert!(apart(&wrong, &truth) < 1e-3);
    wrong[1] = -wrong[1];
    assert!(apart(&wrong, &truth) > 1e-3);
    let other = Latent::from_seed(&Prior::standard(3), 4);
    assert!(apart(&found(&model, &other, &few).matrix, &truth) > 1e-2);
}

#[test]
fn the_number_of_threads_changes_no_bit_and_nothing_gives_zero() {
    let (model, directions) = (odd(3, 16, VnReluForm::Projection), directions(1500));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| found(&model, &at(3), &directions))
    };
    assert_eq!(with(1), with(3));
    let none = found(&model, &at(3), &[]);
    assert!(none.loss == 0.0 && none.matrix.iter().chain(&none.gradient).all(|v| *v == 0.0));
}
