//! The closed-form gradient against differences of the plain f64 network, and what it must not depend on.

use super::reference::Plain;
use super::*;
use crate::field::Gradient;
use crate::latent::{Latent, Prior};

/// A loss that looks at every channel: Σ w (p − t)²/2 with odd weights and targets.
fn loss(i: usize, p: [f64; 3]) -> (f64, [f64; 3]) {
    let weight = 0.5 + (i % 7) as f64;
    let error = [0, 1, 2].map(|c| p[c] - 0.3 * c as f64 + (i % 5) as f64 * 0.2);
    (0.5 * weight * error.iter().map(|e| e * e).sum::<f64>(), error.map(|e| weight * e))
}

fn gradient(model: &Model, latent: &Latent, directions: &[[f32; 3]]) -> Gradient {
    let field = model.decoder().unwrap().condition(latent).unwrap();
    field.gradient(directions, |i, p| {
        let (value, by_output) = loss(i, p.map(f64::from));
        (value, by_output.map(|g| g as f32))
    })
}

fn exact(model: &Model, latent: &Latent, directions: &[[f32; 3]]) -> f64 {
    let plain = Plain(model);
    directions.iter().enumerate().map(|(i, d)| loss(i, plain.log_radiance(latent, *d)).0).sum()
}

fn agrees(found: &Gradient, model: &Model, latent: &Latent, directions: &[[f32; 3]]) {
    let value = exact(model, latent, directions);
    assert!((found.loss - value).abs() < 1e-5 * value, "{} instead of {value}", found.loss);
    let flat: Vec<f32> = found.vectors.as_flattened().iter().copied().chain([found.log_exposure]).collect();
    let scale = flat.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    let count = flat.len();
    for (k, found) in flat.into_iter().enumerate() {
        // f32 latents resolve it, and it hardly ever crosses the kink of a ReLU
        let step = 1.0 / 65536.0;
        let at = |sign: f32| {
            let mut moved = latent.clone();
            match moved.vectors.as_flattened_mut().get_mut(k) {
                Some(c) => *c += sign * step,
                None => moved.log_exposure += sign * step,
            }
            let size = match (moved.vectors.as_flattened().get(k), latent.vectors.as_flattened().get(k)) {
                (Some(a), Some(b)) => f64::from(*a) - f64::from(*b),
                _ => f64::from(moved.log_exposure) - f64::from(latent.log_exposure),
            };
            (exact(model, &moved, directions), size)
        };
        let ((high, up), (low, down)) = (at(1.0), at(-1.0));
        let expected = (high - low) / (up - down);
        let error = (f64::from(found) - expected).abs();
        assert!(
            error < 2e-3 * f64::from(scale),
            "coordinate {k} of {count}: {found}, differences give {expected} (largest {scale})"
        );
    }
}

#[test]
fn differences_of_the_plain_network_agree() {
    for form in [VnReluForm::Projection, VnReluForm::Reference, VnReluForm::ReferenceNormGuard] {
        // sizes that fill no register, and more inputs than one chunk takes
        for (n, hidden) in [(2, 13), (30, 16)] {
            let model = odd(n, hidden, form);
            let mut latent = Latent::from_seed(&Prior::standard(n), 3);
            latent.log_exposure = 0.25;
            let directions = directions(61);
            agrees(&gradient(&model, &latent, &directions), &model, &latent, &directions);
        }
    }
}

#[test]
fn the_papers_size_agrees_too() {
    let model = filler(9);
    let latent = Latent::from_seed(&Prior::standard(9), 1);
    let directions = directions(50);
    agrees(&gradient(&model, &latent, &directions), &model, &latent, &directions);
}

#[test]
fn a_wrong_sign_in_the_target_is_seen() {
    // the comparison above is not a rubber stamp: the gradient at another latent does not pass it
    let model = odd(2, 16, VnReluForm::Projection);
    let [one, other] = [1, 2].map(|seed| Latent::from_seed(&Prior::standard(2), seed));
    let directions = directions(40);
    let mut wrong = gradient(&model, &one, &directions);
    wrong.vectors[1][0] = -wrong.vectors[1][0];
    let caught = |g: &Gradient, at: &Latent| {
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| agrees(g, &model, at, &directions))).is_err()
    };
    assert!(caught(&wrong, &one));
    assert!(caught(&gradient(&model, &other, &directions), &one));
    assert!(!caught(&gradient(&model, &one, &directions), &one));
}

#[test]
fn at_latent_zero_everything_is_finite_and_rotating_rotates_the_gradient() {
    let model = odd(3, 16, VnReluForm::Reference);
    let directions = directions(100);
    let zero = gradient(&model, &Latent::new(vec![[0.0; 3]; 3]), &directions);
    assert!(zero.vectors.as_flattened().iter().all(|v| v.is_finite()));

    let latent = Latent::from_seed(&Prior::standard(3), 5);
    let rotate = |[x, y, z]: [f32; 3]| {
        let (sin, cos) = 0.8f32.sin_cos();
        [x * cos - y * sin, x * sin + y * cos, z]
    };
    let rotated: Vec<_> = directions.iter().map(|d| rotate(*d)).collect();
    let (one, two) =
        (gradient(&model, &latent, &directions), gradient(&model, &latent.rotated(0.8), &rotated));
    let scale = one.vectors.as_flattened().iter().fold(0.0f32, |m, v| m.max(v.abs()));
    for (a, b) in one.vectors.iter().zip(&two.vectors) {
        let a = rotate(*a);
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-4 * scale), "{a:?} {b:?}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit_and_no_direction_is_lost() {
    let model = odd(3, 16, VnReluForm::Projection);
    let latent = Latent::from_seed(&Prior::standard(3), 5);
    let directions = directions(1500);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| gradient(&model, &latent, &directions))
    };
    assert_eq!(with(1), with(3));
    // summed by hand, one at a time
    let field = model.decoder().unwrap().condition(&latent).unwrap();
    let mut sum = [[0.0f64; 3]; 3];
    for (i, d) in directions.iter().enumerate() {
        let one = field.gradient(std::slice::from_ref(d), |_, p| {
            let (value, by_output) = loss(i, p.map(f64::from));
            (value, by_output.map(|g| g as f32))
        });
        for (sum, g) in sum.as_flattened_mut().iter_mut().zip(one.vectors.as_flattened()) {
            *sum += f64::from(*g);
        }
    }
    let whole = with(2);
    let scale = sum.as_flattened().iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for (a, b) in sum.as_flattened().iter().zip(whole.vectors.as_flattened()) {
        assert!((a - f64::from(*b)).abs() < 1e-4 * scale, "{a} {b}");
    }
    assert_eq!(field.gradient(&[], |_, _| (1.0, [1.0; 3])).loss, 0.0);
}
