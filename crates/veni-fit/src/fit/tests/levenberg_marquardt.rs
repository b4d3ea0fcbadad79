//! Levenberg–Marquardt: what it finds, when it ends, where it does not apply.

use super::super::config::Method;
use super::super::levenberg_marquardt::{QuadraticModel, Search};
use super::*;
use veni_light::field::NormalEquations;

fn marquardt() -> FitConfig {
    FitConfig { method: Method::LevenbergMarquardt, ..FitConfig::thorough() }
}

/// Latents near those of seeds 1 and 2.
fn near() -> [Latent; 2] {
    [1, 2].map(|seed| Latent::new(latent(seed).vectors.into_iter().map(|v| v.map(|c| c + 0.03)).collect()))
}

#[test]
fn images_of_the_decoder_itself_are_found_to_the_last_bits() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let images = [1, 2].map(|seed| image(&decoder, grid, seed).iter().map(|v| v + 0.5).collect::<Vec<_>>());
    let views: Vec<_> = images.iter().map(Vec::as_slice).collect();
    let target = FitTarget::panoramas(grid, &views).unwrap();
    let run = |config: FitConfig| {
        let config = FitConfig { prior: 0.0, free_exposure: true, ..config };
        fit(&decoder, &target, &near(), &config).unwrap()
    };
    let found = run(marquardt());
    assert!(found.last.iter().all(|loss| *loss < 1e-9), "{:?}", found.last);
    assert!(found.losses.len() < 60, "{} updates", found.losses.len());
    assert!(found.latents.iter().all(|z| (z.log_exposure - 0.5).abs() < 1e-3));
    // it never goes up, and Adam is still far after as many updates
    assert!(found.losses.windows(2).all(|w| w[1] <= w[0]));
    let adam = run(FitConfig { steps: found.losses.len() as u64, ..FitConfig::light() });
    assert!(adam.last.iter().all(|loss| *loss > 1e-6), "{:?}", adam.last);
}

#[test]
fn it_ends_where_no_direction_goes_down_with_prior_and_every_objective() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    // no image of the decoder
    let image: Vec<f32> = (0..3 * grid.len()).map(|k| (k as f32 * 0.11).sin()).collect();
    let views = [image.as_slice()];
    let target = FitTarget::panoramas(grid, &views).unwrap();
    for objective in &objectives()[..4] {
        let config = FitConfig { objective: *objective, prior: 0.01, free_exposure: true, ..marquardt() };
        let one = FitConfig { method: Method::Adam, steps: 1, ..config };
        let value = |z: &Latent| fit(&decoder, &target, std::slice::from_ref(z), &one).unwrap().losses[0];
        let (start, found) = (latent(3), fit(&decoder, &target, &[latent(3)], &config).unwrap());
        let least = value(&found.latents[0]);
        assert!(least < 0.9 * value(&start), "{objective:?}: {} to {least}", value(&start));
        for k in 0..10 {
            for step in [-0.02, 0.02] {
                let mut moved = found.latents[0].clone();
                match moved.vectors.as_flattened_mut().get_mut(k) {
                    Some(c) => *c += step,
                    None => moved.log_exposure += step,
                }
                let up = value(&moved) - least;
                assert!(up > -1e-3 * least, "{objective:?}, coordinate {k} by {step}: {up} of {least}");
            }
        }
    }
}

#[test]
fn a_wrong_gradient_or_matrix_takes_it_nowhere() {
    // ½ xᵀHx around a start, H far from diagonal
    let h = [[2.0, 1.9, 0.0], [1.9, 2.0, 0.3], [0.0, 0.3, 1.0]];
    let quadratic = |z: &Latent, sign: f64| -> QuadraticModel {
        let x = z.vectors[0].map(f64::from);
        let g: Vec<f64> = h.iter().map(|row| (0..3).map(|k| row[k] * x[k]).sum()).collect();
        let loss = 0.5 * (0..3).map(|k| g[k] * x[k]).sum::<f64>();
        let mut matrix = vec![0.0; 16];
        (0..9).for_each(|k| matrix[k / 3 * 4 + k % 3] = h[k / 3][k % 3]);
        let gradient = g.into_iter().map(|g| sign * g).chain([0.0]).collect();
        QuadraticModel::new(NormalEquations { loss, gradient, matrix }, z.vectors.len(), false)
    };
    let start = Latent::new(vec![[1.0, -2.0, 3.0]]);
    let after = |sign: f64, steps: usize| {
        let mut search = Search::new(start.clone(), quadratic(&start, sign));
        for _ in 0..steps {
            search.step(|z| Ok(quadratic(z, sign))).unwrap();
        }
        search
    };
    let before = quadratic(&start, 1.0);
    let begin = Search::new(start.clone(), before).value();
    assert!(after(1.0, 6).value() < 1e-6 * begin, "{}", after(1.0, 6).value());
    let wrong = after(-1.0, 20);
    assert!(wrong.value() == begin && wrong.ended());
}

#[test]
fn auto_takes_it_for_few_vectors() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let image = image(&decoder, grid, 1);
    let views = [image.as_slice()];
    let target = FitTarget::panoramas(grid, &views).unwrap();
    let config = FitConfig { steps: 5, ..marquardt() };
    let run = |method| fit(&decoder, &target, &[latent(2)], &FitConfig { method, ..config }).unwrap();
    assert_eq!(run(Method::Auto), run(Method::LevenbergMarquardt));
    assert_ne!(run(Method::Auto), run(Method::Adam));
}

#[test]
fn many_vectors_are_explored_first() {
    let config = FitConfig::thorough();
    assert_eq!(config.plan(9, true), [0, 400]);
    assert_eq!(config.plan(100, true), [400, 60]);
    assert_eq!(config.plan(100, false), [400, 0]);
    assert_eq!(config.most_updates(100), 460);
    assert_eq!(FitConfig::light().plan(100, true), [400, 0]);
}
