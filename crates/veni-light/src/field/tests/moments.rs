//! Moments of radiance against sums and differences of the plain f64 network.

use super::normal::{apart, at, jacobian};
use super::reference::Plain;
use super::*;
use crate::field::Moments;

/// Weights of `count` columns, some of them negative; every third direction counts nothing.
fn weights(directions: usize, count: usize) -> Vec<f32> {
    let weight = |k: usize| if (k / count) % 3 == 2 { 0.0 } else { 0.3 - ((5 * k) % 7) as f32 * 0.1 };
    (0..directions * count).map(weight).collect()
}

/// Where the plain network has a derivative, the moments in these directions and their Jacobian.
fn expected(model: &Model, n: usize, count: usize, directions: &[[f32; 3]]) -> (Vec<[f32; 3]>, Moments) {
    let (plain, latent, unknowns) = (Plain(model), at(n), 3 * n + 1);
    let found: Vec<_> =
        directions.iter().filter_map(|d| jacobian(&plain, &latent, *d).map(|rows| (*d, rows))).collect();
    assert!(2 * found.len() > directions.len(), "{} of {} directions", found.len(), directions.len());
    let weights = weights(found.len(), count);
    let (mut values, mut jacobian) = (vec![[0.0; 3]; count], vec![0.0; 3 * count * unknowns]);
    for ((d, rows), weights) in found.iter().zip(weights.chunks_exact(count)) {
        let radiance = plain.log_radiance(&latent, *d).map(f64::exp);
        for (j, weight) in weights.iter().enumerate() {
            for c in 0..3 {
                let light = f64::from(*weight) * radiance[c];
                values[j][c] += light;
                for (k, row) in rows.iter().enumerate() {
                    jacobian[(3 * j + c) * unknowns + k] += light * row[c];
                }
            }
        }
    }
    (found.into_iter().map(|(d, _)| d).collect(), Moments { values, jacobian })
}

fn found(model: &Model, n: usize, count: usize, directions: &[[f32; 3]]) -> Moments {
    let field = model.decoder().unwrap().condition(&at(n)).unwrap();
    field.moments(directions, &weights(directions.len(), count), count)
}

#[test]
fn sums_and_differences_of_the_plain_network_agree() {
    let agrees = |model: &Model, n: usize, count: usize, directions: usize| {
        let (directions, expected) = expected(model, n, count, &super::directions(directions));
        let found = found(model, n, count, &directions);
        let values = apart(found.values.as_flattened(), expected.values.as_flattened());
        let derivatives = apart(&found.jacobian, &expected.jacobian);
        assert!(values < 1e-5 && derivatives < 3e-4, "{n} vectors, {count} sums: {values}, {derivatives}");
        // a weight that is not looked at, or a colour in another's place, would be seen
        let mut wrong = found.jacobian.clone();
        wrong.swap(0, 3 * n + 1);
        assert!(apart(&wrong, &expected.jacobian) > 1e-3);
    };
    agrees(&odd(2, 13, VnReluForm::Projection), 2, 1, 131);
    agrees(&odd(30, 16, VnReluForm::Reference), 30, 5, 131);
    agrees(&filler(9), 9, 9, 60);
}

#[test]
fn the_gradient_of_a_sum_is_that_of_the_other_kernel() {
    let (model, directions, count) = (odd(3, 16, VnReluForm::Projection), directions(700), 4);
    let (moments, weights) = (found(&model, 3, count, &directions), weights(700, count));
    let field = model.decoder().unwrap().condition(&at(3)).unwrap();
    for (j, c) in [(0, 0), (1, 2), (3, 1)] {
        let gradient = field.gradient(&directions, |i, p| {
            let light = f64::from(weights[i * count + j]) * f64::from(p[c]).exp();
            let mut by = [0.0; 3];
            by[c] = light as f32;
            (light, by)
        });
        let flat = gradient.vectors.as_flattened().iter().chain([&gradient.log_exposure]);
        let flat: Vec<f64> = flat.map(|g| f64::from(*g)).collect();
        let row = &moments.jacobian[(3 * j + c) * flat.len()..][..flat.len()];
        assert!(apart(row, &flat) < 1e-5, "{j}, {c}");
        assert!((moments.values[j][c] - gradient.loss).abs() < 1e-6 * gradient.loss.abs());
        // light is e^s times what the vectors say
        assert!((row[flat.len() - 1] - moments.values[j][c]).abs() < 1e-5 * gradient.loss.abs().max(1e-3));
    }
}

#[test]
fn the_number_of_threads_changes_no_bit_and_nothing_gives_zero() {
    let (model, directions) = (odd(3, 16, VnReluForm::Projection), directions(1500));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| found(&model, 3, 2, &directions))
    };
    assert_eq!(with(1), with(3));
    let none = found(&model, 3, 2, &[]);
    assert!(none.values.as_flattened().iter().chain(&none.jacobian).all(|v| *v == 0.0));
    assert_eq!(found(&model, 3, 0, &directions).values.len(), 0);
}
