//! Integrals of light: their gradient, lights that are found again by them, what they leave to the prior, what is refused.

use super::super::network::{ImageLoss, Network};
use super::*;
use crate::fit::config::Method;
use veni_light::light::{LUMINANCE, Sh, sh::pull_back_irradiance};

const GRID: Equirect = Equirect { width: 32, height: 16 };
const WAYS: [[f32; 3]; 3] = [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, -1.0, 0.0]];

fn radiance(light: &Latent) -> Vec<f32> {
    let mut out = vec![[0.0; 3]; GRID.len()];
    decoder().condition(light).unwrap().log_radiance_batch(&GRID.directions(), &mut out);
    out.into_flattened()
}

/// Harmonics of degree 2 and irradiance of a light, which is thereby a perfect fit.
fn target(light: &Latent) -> LinearTarget {
    let field = decoder().condition(light).unwrap();
    let harmonics = Sh::<2>::of_field(&field, GRID).coefficients().to_vec();
    let none = WAYS.map(|way| (way, Received::Irradiance([1.0; 3])));
    let found = LinearTarget::new(GRID).surfaces(&none).unwrap().achieved(&radiance(light)).surfaces;
    let mut surfaces: Vec<_> =
        WAYS.iter().zip(&found).map(|(way, e)| (way.map(|c| 2.0 * c), Received::Irradiance(*e))).collect();
    let lux = found[1].iter().zip(LUMINANCE).map(|(e, y)| e * f64::from(y)).sum();
    surfaces[1].1 = Received::Illuminance(lux);
    LinearTarget::new(GRID).harmonics(&harmonics).unwrap().surfaces(&surfaces).unwrap()
}

fn lit(seed: u64) -> Latent {
    Latent { log_exposure: 0.8, ..latent(seed) }
}

#[test]
fn what_a_light_has_is_what_light_says_of_it() {
    let light = lit(1);
    let target = target(&light);
    let achieved = target.achieved(&radiance(&light));
    assert!(achieved.harmonics_error.unwrap() < 1e-5 && achieved.surfaces_error.unwrap() < 1e-6);
    // twice the light is off by all of it
    let twice: Vec<f32> = radiance(&light).iter().map(|v| v + 2f32.ln()).collect();
    let achieved = target.achieved(&twice);
    for error in [achieved.harmonics_error, achieved.surfaces_error] {
        assert!((error.unwrap() - 1.0).abs() < 1e-4, "{error:?}");
    }
    assert!((target.matching_exposure(&twice) + 2f32.ln()).abs() < 1e-4);
}

#[test]
fn the_gradient_is_the_difference_and_both_ways_to_it_agree() {
    let target = target(&lit(1));
    let at: Vec<f64> = radiance(&lit(2)).iter().map(|v| f64::from(*v)).collect();
    let (loss, gradient) = target.with_gradient(&at);
    assert!(loss > 1e-3);
    for k in [0, 100, 301, 800, 1300] {
        let moved = |step: f64| {
            let mut at = at.clone();
            at[k] += step;
            target.with_gradient(&at).0
        };
        let difference = (moved(1e-4) - moved(-1e-4)) / 2e-4;
        assert!(
            (difference - gradient[k]).abs() < 1e-6 * difference.abs() + 1e-12,
            "{k}: {difference} {}",
            gradient[k]
        );
    }
    // through the decoder: the Jacobian of the moments, and a pass backward
    let (decoder, light) = (decoder(), lit(2));
    let network = Network::new(&decoder, GRID.directions());
    let loss_of = ImageLoss::Linear(&target);
    let passed = network.evaluate(std::slice::from_ref(&light), &loss_of).unwrap();
    let equations = network.equations(&light, &loss_of, 0).unwrap();
    assert!((equations.loss - loss).abs() < 1e-5 * loss && (passed.losses[0] - loss).abs() < 1e-5 * loss);
    let all: Vec<f64> = [&passed.gradient.vectors[..], &passed.gradient.exposures].concat();
    let scale = all.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    for (k, (a, b)) in all.iter().zip(&equations.gradient).enumerate() {
        assert!((a - b).abs() < 1e-4 * scale, "{k}: {a} {b}");
        let moved = |step: f32| {
            let mut light = light.clone();
            match light.vectors.as_flattened_mut().get_mut(k) {
                Some(c) => *c += step,
                None => light.log_exposure += step,
            }
            network.losses(&[light], &loss_of).unwrap()[0]
        };
        let difference = (moved(2e-3) - moved(-2e-3)) / 4e-3;
        assert!((difference - b).abs() < 2e-2 * scale, "{k}: {difference} {b}");
    }
    // the exposure's column of J is light itself: its element of 2 Jᵀ J is twice Σ weight · light²
    let last = all.len() - 1;
    let dark: Vec<f64> = vec![-1e3; at.len()];
    let (wanted, found) = (target.with_gradient(&dark).0, equations.matrix[last * (last + 2)]);
    // (light − wanted)² = light² − 2 light wanted + wanted², and the derivative by the exposure is 2 light (light − wanted)
    let expected = 2.0 * (wanted - loss + equations.gradient[last]);
    assert!((found - expected).abs() < 1e-4 * expected, "{found} {expected}");
}

#[test]
fn the_gradient_is_that_of_light_s_own_pull_backs() {
    let (decoder, light) = (decoder(), lit(2));
    let field = decoder.condition(&light).unwrap();
    // a single surface: the loss is ((E − t)/t)², its derivative by E is 2 (E − t)/t²
    let only = LinearTarget::new(GRID).surfaces(&[(WAYS[1], Received::Irradiance([3.0, 0.0, 0.0]))]).unwrap();
    let e = only.achieved(&radiance(&light)).surfaces[0];
    let cotangent = [2.0 * (e[0] - 3.0) / 9.0, 2.0 * e[1] / 9.0, 2.0 * e[2] / 9.0];
    let expected = pull_back_irradiance(&field, GRID, &[(WAYS[1], cotangent)]);
    let network = Network::new(&decoder, GRID.directions());
    let found = network.equations(&light, &ImageLoss::Linear(&only), 0).unwrap();
    for (a, b) in expected.vectors.as_flattened().iter().zip(&found.gradient) {
        assert!((f64::from(*a) - b).abs() < 1e-4 * found.gradient[9].abs(), "{a} {b}");
    }
}

#[test]
fn at_half_the_resolution_the_same_is_wanted() {
    let grid = Equirect::new(128, 64);
    let wanted = Sh::<2>::of_field(&decoder().condition(&lit(2)).unwrap(), grid);
    let surfaces = WAYS.map(|way| (way, Received::Illuminance(2.0)));
    let fine = LinearTarget::new(grid).harmonics(wanted.coefficients()).unwrap().surfaces(&surfaces).unwrap();
    let [_, coarse, _] = &fine.levels()[..] else { panic!("32 × 16, 64 × 32, 128 × 64") };
    assert_eq!(super::super::likely_searches(&fine), 4 + 2);
    let of = |target: &LinearTarget, light: &Latent| {
        let mut values = vec![[0.0; 3]; target.grid().len()];
        decoder().condition(light).unwrap().log_radiance_batch(&target.grid().directions(), &mut values);
        target.achieved(values.as_flattened())
    };
    assert_eq!(coarse.grid(), Equirect::new(64, 32));
    let (a, b) = (of(&fine, &lit(2)), of(coarse, &lit(2)));
    assert!(a.harmonics_error.unwrap() < 1e-4 && b.harmonics_error.unwrap() < 0.02, "{a:?} {b:?}");
    for (a, b) in a.surfaces.iter().flatten().zip(b.surfaces.iter().flatten()) {
        assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
    }
    assert!(of(coarse, &lit(3)).harmonics_error.unwrap() > 0.2);
    assert!(LinearTarget::new(Equirect::new(32, 16)).coarser().is_none());
}

#[test]
fn a_light_is_found_again_by_its_integrals_with_either_method() {
    // of a trained decoder: the light of one with weights from a formula has a minimum at every turn
    let model = Model::pretrained();
    let decoder = model.decoder().unwrap();
    // of the vectors: what a sun adds no fit of integrals looks for
    let truth = Latent::new(Latent::from_seed(&model.prior(), 6).vectors);
    let light = |light: &Latent| {
        let mut out = vec![[0.0; 3]; GRID.len()];
        decoder.condition(light).unwrap().log_radiance_batch(&GRID.directions(), &mut out);
        out.into_flattened()
    };
    let wanted = Sh::<2>::of_field(&decoder.condition(&truth).unwrap(), GRID);
    let target = LinearTarget::new(GRID).harmonics(wanted.coefficients()).unwrap();
    let mut start = Latent::new(vec![[0.0; 3]; 9]);
    start.log_exposure = target.matching_exposure(&light(&start));
    let run = |method: Method| {
        let config = FitConfig { method, ..FitConfig::linear() };
        let prior = model.prior();
        let starts = std::slice::from_ref(&start);
        let found = likely_linear(&decoder, &target, Some(&prior), starts, &config, &mut |_, _| {}).unwrap();
        assert!(
            (target
                .with_gradient(&light(&found.latents[0]).iter().map(|v| f64::from(*v)).collect::<Vec<_>>())
                .0
                - found.last[0])
                .abs()
                < 1e-6
        );
        (target.achieved(&light(&found.latents[0])).harmonics_error.unwrap(), found.losses.len())
    };
    let before = target.achieved(&light(&start)).harmonics_error.unwrap();
    let (marquardt, adam) = (run(Method::Auto), run(Method::Adam));
    assert!(before > 0.1 && marquardt.0 < 1e-3, "{marquardt:?} from {before}");
    // which makes as many steps here, and needs ten times as many
    assert!(adam.0 < 0.5 * before, "{adam:?} from {before}");
}

#[test]
fn what_integrals_leave_open_is_left_to_the_prior() {
    let (decoder, prior) = (decoder(), Prior::standard(3));
    let surfaces = [(WAYS[0], Received::Illuminance(5e4))];
    let target = LinearTarget::new(GRID).surfaces(&surfaces).unwrap();
    let matched = |light: Latent| {
        let log_exposure = light.log_exposure + target.matching_exposure(&radiance(&light));
        Latent { log_exposure, ..light }
    };
    let starts = [lit(4), lit(5)].map(matched);
    let config = FitConfig::linear();
    let found = best_linear(&decoder, &target, &prior, &starts, &config, &mut |_, _| {}).unwrap();
    assert_eq!((found.latent == found.all[0], found.all.len()), (true, 2), "the likely one is the best");
    let light = &found.latent;
    // one number, and one exposure to meet it: the vectors are the prior's mean
    let farthest = light.vectors.as_flattened().iter().fold(0.0f32, |m, c| m.max(c.abs()));
    assert!(farthest < 0.3, "{light:?}");
    // led by nothing, the other stays where it was: as good in what is asked, and apart in the rest
    let other = target.achieved(&radiance(&found.all[1])).surfaces_error.unwrap();
    let far = found.all[1].vectors.as_flattened().iter().fold(0.0f32, |m, c| m.max(c.abs()));
    assert!(other < 1e-3 && far > 0.5, "{other}, {far}");
    assert!(target.achieved(&radiance(light)).surfaces_error.unwrap() < 1e-3);
}

#[test]
fn what_is_no_light_is_refused() {
    let said = |result: crate::Result<LinearTarget>, words: &[&str]| {
        let message = result.unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    let empty = || LinearTarget::new(GRID);
    said(empty().harmonics(&[]), &["0 harmonics", "1, 4, 9"]);
    said(empty().harmonics(&[[1.0; 3]; 5]), &["5 harmonics"]);
    said(empty().harmonics(&[[1.0; 3]; 289]), &["289 harmonics", "256"]);
    said(empty().harmonics(&[[-1.0, 1.0, 1.0]]), &["harmonic 0", "-1"]);
    said(empty().harmonics(&[[0.0; 3]; 4]), &["harmonic 0", "all 0"]);
    said(empty().harmonics(&[[1.0, f64::NAN, 0.0]]), &["harmonic 0", "NaN", "finite"]);
    said(empty().harmonics(&[[1e30; 3]]), &["e30", "unit"]);
    said(empty().harmonics(&[[1.0; 3]]).unwrap().harmonics(&[[1.0; 3]]), &["once"]);
    let lit = |normal: [f32; 3], e: f64| empty().surfaces(&[(normal, Received::Illuminance(e))]);
    said(empty().surfaces(&[]), &["at least one"]);
    said(lit([0.0; 3], 1.0), &["surface 0", "not a direction"]);
    said(lit(WAYS[0], -1.0), &["surface 0", "-1", "not negative"]);
    said(lit(WAYS[0], 0.0), &["all of the light is 0"]);
    said(lit(WAYS[0], 1.0).unwrap().surfaces(&[(WAYS[1], Received::Illuminance(1.0))]), &["once"]);
    said(empty().surfaces(&[(WAYS[0], Received::Illuminance(1.0)); 257]), &["257 surfaces", "256"]);
    let fit = |target: &LinearTarget, start: &[Latent]| {
        fit_linear(&decoder(), target, None, start, &FitConfig::linear(), &mut |_, _| {})
            .unwrap_err()
            .to_string()
    };
    assert!(fit(&empty(), &[latent(1)]).contains("without harmonics"));
    assert!(fit(&lit(WAYS[0], 1.0).unwrap(), &[]).contains("0 latents"));
}
