//! Latents that are found again, masks, clipping, exposures, settings: everything that needs no graph of tensors.

mod levenberg_marquardt;
mod linear;
mod lobes;

use super::pixel::PixelValue;
use super::*;
use veni_light::field;
use veni_light::model::{DecoderConfig, Model, ModelConfig};
use veni_light::random::{Purpose, stream};
use veni_light::sphere::Equirect;

/// A small decoder with weights from a formula.
pub(super) fn decoder() -> field::Decoder {
    let config = DecoderConfig { hidden: 16, layers: 2, heads: 2, ..DecoderConfig::default() };
    let config = ModelConfig { decoder: config, ..ModelConfig::decode_only(3) };
    Model::filler(&config, 1).unwrap().decoder().unwrap()
}

pub(super) fn latent(seed: u64) -> Latent {
    let mut rng = stream(seed, Purpose::Fit, 0, 0);
    Latent::new((0..3).map(|_| [0; 3].map(|_| rng.normal() as f32)).collect())
}

fn image(decoder: &field::Decoder, grid: Equirect, seed: u64) -> Vec<f32> {
    let mut out = vec![[0.0; 3]; grid.len()];
    decoder.condition(&latent(seed)).unwrap().log_radiance_batch(&grid.directions(), &mut out);
    out.into_flattened()
}

/// Those that look at each pixel alone.
fn objectives() -> [Objective; 5] {
    [
        Objective::LogError,
        Objective::LogAbsolute,
        Objective::Display { log: 0.01 },
        Objective::Energy { weight: 0.4 },
        Objective::ReferenceLogError,
    ]
}

#[test]
fn images_of_the_decoder_itself_are_found_again() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let images = [1, 2].map(|seed| image(&decoder, grid, seed));
    let views: Vec<_> = images.iter().map(Vec::as_slice).collect();
    let target = FitTarget::panoramas(grid, &views).unwrap();
    let config = FitConfig { prior: 0.0, ..FitConfig::light() };
    let moved = |seed| Latent::new(latent(seed).vectors.into_iter().map(|v| v.map(|c| c + 0.03)).collect());
    let start = [1, 2].map(moved);
    let result = fit(&decoder, &target, &start, &config).unwrap();
    let (first, last) = (result.losses[0], *result.losses.last().unwrap());
    assert!(last < 0.02 * first, "{first} to {last}");
}

#[test]
fn a_mask_hides_what_it_covers_and_a_free_scale_finds_the_exposure() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let mut image = image(&decoder, grid, 1);
    let mut mask = vec![1.0; grid.len()];
    for p in 0..40 {
        mask[p] = 0.0;
        image[3 * p..3 * p + 3].fill(50.0);
    }
    let run = |image: &[f32], free_exposure| {
        let (images, masks) = ([image], [mask.as_slice()]);
        let target = FitTarget::panoramas(grid, &images).unwrap().masked(&masks).unwrap();
        let config = FitConfig { steps: 60, prior: 0.0, free_exposure, ..FitConfig::light() };
        fit(&decoder, &target, &[latent(1)], &config).unwrap()
    };
    let exact = run(&image, false);
    assert!(exact.losses[0] < 1e-9, "what is masked does not count: {}", exact.losses[0]);
    let brighter: Vec<f32> = image.iter().map(|v| v + 0.7).collect();
    let scaled = run(&brighter, true);
    assert!(scaled.losses[59] < 0.1 * scaled.losses[0]);
    assert!(scaled.latents[0].log_exposure > 0.2);
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let (decoder, grid) = (decoder(), Equirect::new(4, 2));
    let image = vec![0.0; 24];
    let message = |images: &[&[f32]], masks: Option<&[&[f32]]>, start: &[Latent]| {
        let target = FitTarget::panoramas(grid, images);
        let target = target.and_then(|target| match masks {
            Some(masks) => target.masked(masks),
            None => Ok(target),
        });
        let result = target.and_then(|target| fit(&decoder, &target, start, &FitConfig::light()));
        result.unwrap_err().to_string()
    };
    assert!(message(&[], None, &[]).contains("0 images"));
    assert!(message(&[&image], None, &[]).contains("0 latents"));
    assert!(message(&[&image[1..]], None, &[latent(1)]).contains("23 values"));
    assert!(message(&[&image], None, &[Latent::new(latent(1).vectors[..2].to_vec())]).contains("2 vectors"));
    let empty = [0.0; 8];
    assert!(message(&[&image], Some(&[&empty]), &[latent(1)]).contains("mask"));
}

/// One pixel with half of the light gets its area's part of 1 − weight and half of the weight; what a mask hides gets
/// nothing, whatever stands there.
#[test]
fn light_deals_out_its_part_of_the_weight() {
    let grid = Equirect::new(4, 2);
    let mut image = vec![0.0; 24];
    // eight pixels of one area, one of them hidden: six of radiance 1, and one of 6
    image[3..6].fill(6.0f32.ln());
    image[9..12].fill(f32::INFINITY);
    let mask: Vec<f32> = (0..8).map(|p| f32::from(p != 3)).collect();
    let (images, masks) = ([image.as_slice()], [mask.as_slice()]);
    let target = FitTarget::panoramas(grid, &images).unwrap().masked(&masks).unwrap();
    let loss = |weight: f64, which: &dyn Fn(usize) -> bool| -> f64 {
        let loss = PixelLoss::new(Objective::Energy { weight }, target.images()[0], &target.areas());
        let off = |p: usize| [0, 1, 2].map(|c| f64::from(image[3 * p + c]) + 1e-3);
        (0..8).filter(|p| which(*p)).map(|p| 1e6 * loss.at(p, off(p)).loss).sum()
    };
    for weight in [0.0, 0.3, 1.0] {
        assert!((loss(weight, &|_| true) - 1.0).abs() < 1e-5, "a small error e everywhere is e²");
        let expected = (1.0 - weight) / 7.0 + 0.5 * weight;
        let found = loss(weight, &|p| p == 1);
        assert!((found - expected).abs() < 1e-5, "{weight}: {found} instead of {expected}");
        assert_eq!(loss(weight, &|p| p == 3), 0.0);
    }
    // what is far off is a line: twice as far costs twice as much, not four times
    let all_light = PixelLoss::new(Objective::Energy { weight: 1.0 }, target.images()[0], &target.areas());
    let cost = |e: f64| all_light.at(0, [e; 3]).loss;
    assert!((cost(200.0) / cost(100.0) - 2.0).abs() < 0.02);
}

#[test]
fn gradients_are_those_of_the_pixel_losses() {
    let grid = Equirect::new(4, 2);
    let image: Vec<f32> = (0..24).map(|k| (k as f32 * 0.7).sin()).collect();
    let clipped: Vec<bool> = (0..24).map(|k| k % 3 == 0).collect();
    let (images, clips) = ([image.as_slice()], [clipped.as_slice()]);
    let target = FitTarget::panoramas(grid, &images).unwrap().clipped(&clips).unwrap();
    for objective in &objectives() {
        let loss = PixelLoss::new(*objective, target.images()[0], &target.areas());
        for pixel in 0..8 {
            let p = [0, 1, 2].map(|c| (1.3 * (3 * pixel + c) as f64).cos());
            let PixelValue { gradient, gauss_newton, .. } = loss.at(pixel, p);
            for c in 0..3 {
                let moved = |step: f64| {
                    let mut q = p;
                    q[c] += step;
                    loss.at(pixel, q).loss
                };
                let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                assert!((gradient[c] - expected).abs() < 1e-7, "{objective:?}, {pixel}, {c}");
                // a clipped value is left alone on one side only
                if clipped[3 * pixel + c] {
                    continue;
                }
                // the parabola lies above an absolute error, and is a squared error itself
                let parabola =
                    |d: f64| loss.at(pixel, p).loss + gradient[c] * d + 0.5 * gauss_newton[c] * d * d;
                for over in [-1.0, -0.1, 0.1, 1.0].map(|d| parabola(d) - moved(d)) {
                    match objective {
                        Objective::LogAbsolute => assert!(over > -1e-9, "{pixel}, {c}: {over}"),
                        Objective::Energy { .. } => assert!(over > -1e-9, "{pixel}, {c}: {over}"),
                        Objective::LogError => assert!(over.abs() < 1e-9, "{pixel}, {c}: {over}"),
                        _ => {}
                    }
                }
            }
        }
    }
}

#[test]
fn clipped_values_ask_only_for_at_least_as_much() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let truth = image(&decoder, grid, 1);
    // everything above a level is cut off
    let level = 0.05;
    let cut: Vec<f32> = truth.iter().map(|v| v.min(level)).collect();
    let clipped: Vec<bool> = truth.iter().map(|v| *v >= level).collect();
    assert!(clipped.iter().filter(|c| **c).count() > 20, "nothing to clip");
    let loss = |clipped: Option<&[&[bool]]>| {
        let images = [cut.as_slice()];
        let target = FitTarget::panoramas(grid, &images).unwrap();
        let target = match clipped {
            Some(clipped) => target.clipped(clipped).unwrap(),
            None => target,
        };
        let config = FitConfig { steps: 1, prior: 0.0, ..FitConfig::light() };
        fit(&decoder, &target, &[latent(1)], &config).unwrap().losses[0]
    };
    assert!(loss(Some(&[&clipped])) < 1e-12, "the truth fits an image that is cut off");
    assert!(loss(None) > 1e-6, "without the flag it does not");
}

#[test]
fn a_fit_ends_on_a_plateau_and_says_what_it_reached() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let image = image(&decoder, grid, 1);
    let images = [image.as_slice()];
    let target = FitTarget::panoramas(grid, &images).unwrap();
    let plateau = Some(Plateau { patience: 20, improvement: 1e-2 });
    let config = FitConfig { steps: 5000, plateau, prior: 0.0, ..FitConfig::light() };
    let mut calls = 0;
    let result = fit_with(&decoder, &target, &[latent(2)], &config, None, &mut |_, _| calls += 1).unwrap();
    assert!((21..4000).contains(&result.losses.len()), "{}", result.losses.len());
    assert_eq!(calls, result.losses.len());
    let again = FitConfig { steps: 0, ..config };
    let again = fit(&decoder, &target, &result.latents, &again).unwrap();
    assert_eq!(again.last, result.last);
    assert_eq!(again.latents, result.latents);
}

#[test]
fn of_several_starts_the_best_is_kept_and_the_seed_decides() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let image = image(&decoder, grid, 1);
    let images = [image.as_slice()];
    let target = FitTarget::panoramas(grid, &images).unwrap();
    let prior = veni_light::latent::Prior::standard(3);
    let starts = random_starts(&prior, 0.5, 3, 7);
    assert_eq!(starts, random_starts(&prior, 0.5, 3, 7));
    assert_ne!(starts[0], starts[1]);
    let config = FitConfig { steps: 30, ..FitConfig::light() };
    let best = best_of(&decoder, &target, &starts, &config, &mut |_, _| {}).unwrap();
    assert_eq!((best.all.len(), best.losses.len()), (3, 3));
    let least = best.losses.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(best.loss, least);
    assert!(best.losses.iter().any(|l| *l > least), "three starts that end alike show nothing");
}

#[test]
fn settings_that_make_no_sense_are_refused_by_name() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let image = image(&decoder, grid, 1);
    let images = [image.as_slice()];
    let whole = FitTarget::panoramas(grid, &images).unwrap();
    let message = |target: &FitTarget<'_>, config: FitConfig| {
        fit(&decoder, target, &[latent(1)], &config).unwrap_err().to_string()
    };
    let light = FitConfig::light();
    assert!(message(&whole, FitConfig { prior: -1.0, ..light }).contains("prior = -1"));
    let objective = Objective::Energy { weight: 1.5 };
    assert!(message(&whole, FitConfig { objective, ..light }).contains("weight = 1.5"));
    let rays = FitConfig { objective: Objective::CosineScaleInvariant, ..light };
    assert!(message(&whole, rays).contains("whole images"));
    let mut hole = image.clone();
    hole[7] = f32::NAN;
    let hole = [hole.as_slice()];
    assert!(message(&FitTarget::panoramas(grid, &hole).unwrap(), light).contains("pixel 2 is NaN"));
    let areas = vec![0.0; grid.len()];
    let refused = whole.clone().in_directions(grid.directions(), Some(&areas)).unwrap_err().to_string();
    assert!(refused.contains("areas"), "{refused}");
    assert!(whole.in_directions(vec![[0.0; 3]; 7], None).unwrap_err().to_string().contains("7 directions"));
}
