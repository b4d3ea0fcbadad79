//! The normal equations against differences of the plain f64 network.

use super::reference::Plain;
use super::*;
use crate::field::{LocalQuadratic, NormalEquations};
use crate::latent::{Latent, Lobe, Prior};

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

/// Three lobes of different widths, with amplitudes of either sign.
fn lobes() -> Vec<Lobe> {
    let lobe = |direction: [f32; 3], amplitude, sharpness| {
        let length = direction.iter().map(|c| c * c).sum::<f32>().sqrt();
        Lobe { direction: direction.map(|c| c / length), amplitude, sharpness }
    };
    vec![
        lobe([0.3, 0.2, 0.9], [1.5, 1.0, -0.5], 3.0),
        lobe([-0.7, 0.7, -0.1], [-0.4, 0.2, 0.9], 20.0),
        lobe([0.0, 0.0, -1.0], [1.0, 2.0, 0.0], 1.0),
    ]
}

/// The rows of the lobes by central differences of their closed form in f64.
fn lobe_rows(lobes: &[Lobe], d: [f32; 3]) -> Vec<[f64; 3]> {
    let value = |lobe: &Lobe, by: [f64; Lobe::COORDINATES]| -> [f64; 3] {
        let ([p, q], u) = (lobe.tangents().map(|t| t.map(f64::from)), lobe.direction.map(f64::from));
        let moved = [0, 1, 2].map(|k| u[k] + by[4] * p[k] + by[5] * q[k]);
        let length = moved.iter().map(|c| c * c).sum::<f64>().sqrt();
        let cosine: f64 = moved.iter().zip(d).map(|(a, b)| a / length * f64::from(b)).sum();
        let gauss = (f64::from(lobe.sharpness) * by[3].exp() * (cosine - 1.0)).exp();
        [0, 1, 2].map(|c| (f64::from(lobe.amplitude[c]) + by[c]) * gauss)
    };
    let row = |lobe: &Lobe, k: usize| {
        let at = |step: f64| value(lobe, std::array::from_fn(|j| if j == k { step } else { 0.0 }));
        let (high, low) = (at(1e-5), at(-1e-5));
        [0, 1, 2].map(|c| (high[c] - low[c]) / 2e-5)
    };
    lobes.iter().flat_map(|lobe| (0..Lobe::COORDINATES).map(move |k| row(lobe, k))).collect()
}

#[test]
fn lobes_are_unknowns_too() {
    let (n, directions) = (3, directions(131));
    let (model, latent) = (odd(n, 16, VnReluForm::Projection), Latent { lobes: lobes(), ..at(3) });
    let field = model.decoder().unwrap().condition(&latent).unwrap();
    // each direction alone, so that the matrix is that of its own rows; without the vectors, whose rows have a test above
    let first = 3 * n + 1;
    for d in &directions {
        let found = field.normal_equations_with_lobes(&[*d], loss);
        let unknowns = found.gradient.len();
        assert_eq!(unknowns, first + Lobe::COORDINATES * latent.lobes.len());
        let local = loss(0, field.log_radiance(*d));
        let rows = lobe_rows(&latent.lobes, *d);
        let gradient: Vec<f64> =
            rows.iter().map(|row| (0..3).map(|c| row[c] * f64::from(local.gradient[c])).sum()).collect();
        assert!(apart(&found.gradient[first..], &gradient) < 1e-4, "{d:?}");
        let weight = local.weight.map(f64::from);
        let product = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|c| weight[c] * a[c] * b[c]).sum::<f64>();
        let expected: Vec<f64> = rows.iter().flat_map(|a| rows.iter().map(move |b| product(a, b))).collect();
        let matrix: Vec<f64> =
            found.matrix.chunks_exact(unknowns).skip(first).flat_map(|row| &row[first..]).copied().collect();
        assert!(apart(&matrix, &expected) < 1e-4, "{d:?}");
        // and a lobe that is moved is not the one that stays
        let mut other = rows;
        other[0][0] += 0.1;
        let wrong: Vec<f64> = other.iter().flat_map(|a| other.iter().map(move |b| product(a, b))).collect();
        assert!(apart(&matrix, &wrong) > 1e-4);
    }
    // beside the lobes everything is as without them
    let [with, without] =
        [field.normal_equations_with_lobes(&directions, loss), field.normal_equations(&directions, loss)];
    let unknowns = with.gradient.len();
    let part: Vec<f64> =
        with.matrix.chunks_exact(unknowns).take(first).flat_map(|row| &row[..first]).copied().collect();
    assert!(apart(&part, &without.matrix) < 1e-5 && apart(&with.gradient[..first], &without.gradient) < 1e-5);
}

#[test]
fn lobes_alone_have_the_rows_that_they_have_beside_a_latent() {
    let (n, directions) = (3, directions(131));
    let (model, latent) = (odd(n, 16, VnReluForm::Projection), Latent { lobes: lobes(), ..at(3) });
    let decoder = model.decoder().unwrap();
    let of = |latent: &Latent| decoder.condition(latent).unwrap();
    let mut base = vec![[0.0; 3]; directions.len()];
    of(&Latent { lobes: Vec::new(), ..latent.clone() }).log_radiance_batch(&directions, &mut base);
    let all = of(&latent).normal_equations_with_lobes(&directions, loss);
    let (unknowns, first) = (all.gradient.len(), 3 * n + 1);
    let block: Vec<f64> =
        all.matrix.chunks_exact(unknowns).skip(first).flat_map(|row| &row[first..]).copied().collect();
    let alone = |lobes: &[Lobe]| NormalEquations::of_lobes(lobes, &base, &directions, loss);
    let found = alone(&latent.lobes);
    assert!((found.loss / all.loss - 1.0).abs() < 1e-5, "{} for {}", found.loss, all.loss);
    assert!(apart(&found.gradient, &all.gradient[first..]) < 1e-5);
    assert!(apart(&found.matrix, &block) < 1e-5);
    // red and green taken for each other
    let mut other = latent.lobes.clone();
    other[0].amplitude.swap(0, 1);
    assert!(apart(&alone(&other).matrix, &block) > 1e-3);
    let none = alone(&[]);
    assert!(none.gradient.is_empty() && none.matrix.is_empty() && none.loss > 0.0);
}

#[test]
fn a_moved_lobe_stays_on_the_sphere_and_rotates_with_its_tangents() {
    for lobe in lobes() {
        let by = [0.1, -0.2, 0.3, 0.4, 0.05, -0.1];
        let moved = lobe.moved(&by);
        let length = |v: [f32; 3]| v.iter().map(|c| c * c).sum::<f32>().sqrt();
        assert!((length(moved.direction) - 1.0).abs() < 1e-6);
        assert!((moved.sharpness / lobe.sharpness - 0.4f32.exp()).abs() < 1e-5);
        let angle = moved.direction.iter().zip(lobe.direction).map(|(a, b)| a * b).sum::<f32>().acos();
        assert!((angle - (0.05f32.hypot(0.1)).atan()).abs() < 1e-3, "{angle}");
        if lobe.direction[2].abs() < 0.99 {
            let (one, two) = (lobe.rotated(0.7).moved(&by), moved.rotated(0.7));
            let apart = one.direction.iter().zip(two.direction).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f32::max) < 1e-6, "{one:?} {two:?}");
        }
    }
}
