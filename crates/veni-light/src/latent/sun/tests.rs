use super::*;
use crate::compact::Lights;
use crate::latent::Latent;
use crate::latent::Prior;
use crate::random::Stream;

const N: usize = 4;

/// A prior whose suns follow the vectors closely in azimuth, and loosely in the rest.
fn truth() -> Prior {
    let mut measures = vec![0.0; MEASURES * N];
    measures[0] = 0.8;
    measures[N + 1] = -0.6;
    let mut noise = [[0.0; MEASURES]; MEASURES];
    (0..MEASURES).for_each(|k| noise[k][k] = 0.3);
    // higher suns are stronger
    noise[LUMINANCE][ELEVATION] = 0.2;
    let sun = SunPrior {
        azimuth: vec![[0.9, 0.3], [0.0, 0.0], [-0.2, 0.1], [0.0, 0.0]],
        azimuth_noise: 0.2,
        weights: measures,
        mean: [-0.3, 1.0, 0.1, -0.2, -4.0],
        noise,
        presence: vec![0.0, 0.0, 1.5, 0.0, 0.3],
    };
    Prior { sun: Some(sun), ..Prior::standard(N) }
}

/// What is learned of codes.
fn fitted(codes: &[Latent]) -> Option<SunPrior> {
    Prior::standard(N).with_suns_of(codes).sun
}

fn drawn(count: u64) -> Vec<Latent> {
    (0..count).map(|seed| Latent::from_seed(&truth(), seed)).collect()
}

fn heading(latent: &Latent) -> f64 {
    f64::from(latent.lights.sun().unwrap().azimuth())
}

#[test]
fn vectors_of_a_seed_are_those_without_suns() {
    let plain = Prior::standard(N);
    for seed in 0..20 {
        let (a, b) = (Latent::from_seed(&plain, seed), Latent::from_seed(&truth(), seed));
        assert_eq!((a.vectors, a.log_exposure), (b.vectors.clone(), b.log_exposure));
        b.check_finite().unwrap();
    }
    let suns = drawn(2000).iter().filter(|latent| latent.lights.sun().is_some()).count();
    // P(1.5 g + 0.3 + η > 0) = Φ(0.3 / √3.25)
    assert!((suns as f64 / 2000.0 - 0.566).abs() < 0.04, "{suns}");
}

#[test]
fn what_was_drawn_is_learned() {
    let (codes, truth) = (drawn(3000), truth());
    let fitted = fitted(&codes).unwrap();
    let sun = truth.sun().unwrap();
    // the heading is of length 1 in the fit: a by its scale, which the noise has too
    let scale = fitted.azimuth[0][0] / sun.azimuth[0][0];
    for (a, b) in fitted.azimuth.iter().zip(&sun.azimuth) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - scale * b).abs() < 0.05), "{fitted:?}");
    }
    let near = |a: &[f32], b: &[f32], by: f32| a.iter().zip(b).all(|(a, b)| (a - b).abs() < by);
    assert!(near(&fitted.weights[..4 * N], &sun.weights[..4 * N], 0.03), "{fitted:?}");
    assert!(near(&fitted.mean[..4], &sun.mean[..4], 0.03), "{fitted:?}");
    assert!(near(fitted.noise[LUMINANCE].as_slice(), &sun.noise[LUMINANCE], 0.03), "{fitted:?}");
    assert!(near(&fitted.presence, &sun.presence, 0.2), "{fitted:?}");
}

#[test]
fn turning_the_codes_turns_the_suns_and_changes_no_fit() {
    let codes = drawn(300);
    let turned: Vec<_> = codes.iter().enumerate().map(|(i, code)| code.rotated(i as f64)).collect();
    let (a, b) = [&codes, &turned].map(|codes| fitted(codes).unwrap()).into();
    assert!(a.azimuth.as_flattened().iter().zip(b.azimuth.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-5));
    assert_eq!((a.weights, a.presence), (b.weights, b.presence));
    // a break: suns that did not turn with their codes say nothing
    let still = codes
        .iter()
        .zip(&turned)
        .map(|(code, turned)| Latent { lights: code.lights.clone(), ..turned.clone() });
    let broken = fitted(&still.collect::<Vec<_>>()).unwrap();
    assert!(
        broken.azimuth_noise > 0.9 && a.azimuth_noise < 0.7,
        "{} {}",
        broken.azimuth_noise,
        a.azimuth_noise
    );
}

#[test]
fn too_few_suns_teach_nothing() {
    let codes: Vec<_> = drawn(40).into_iter().filter(|latent| latent.lights.sun().is_some()).collect();
    assert!(fitted(&codes[..7]).is_none());
    let some = fitted(&codes[..8]).unwrap();
    assert!(some.presence[..N].iter().all(|p| *p == 0.0) && some.presence[N] > 0.5, "{some:?}");
    let dark: Vec<_> =
        codes.iter().map(|code| Latent { lights: Lights::default(), ..code.clone() }).collect();
    assert!(fitted(&dark).is_none());
}

/// A code whose sun is as asked: presence and elevation by one step, the azimuth by another.
fn asked(request: &SunRequest, seed: u64) -> Latent {
    let prior = truth();
    let sun = prior.sun().unwrap();
    let mut draw = prior.draw(&mut Stream::from_seed(seed));
    if let Some(azimuth) = request.azimuth {
        sun.head(azimuth, &mut draw);
    }
    let rows = sun.rows(request, &draw);
    draw.shift(&rows);
    prior.code(&draw)
}

#[test]
fn requests_are_fulfilled() {
    let truth = truth();
    for seed in 0..50 {
        let sample = |request: &SunRequest| asked(request, seed);
        let plain = Latent { source: None, ..Latent::from_seed(&truth, seed) };
        assert_eq!(sample(&SunRequest::default()), plain);
        let there = SunRequest { azimuth: Some(2.0), elevation: Some(0.3), ..SunRequest::default() };
        let latent = sample(&there);
        let sun = latent.lights.sun().unwrap();
        assert!((sun.azimuth() - 2.0).abs() < 1e-5 && (sun.elevation() - 0.3).abs() < 1e-5, "{sun:?}");
        for present in [true, false] {
            let latent = sample(&SunRequest { present: Some(present), ..SunRequest::default() });
            assert_eq!(latent.lights.sun().is_some(), present);
            if plain.lights.sun().is_some() == present {
                assert_eq!(latent, plain, "nothing had to move");
            }
        }
        // extremes stay finite
        for elevation in [-1.0, 0.0, std::f64::consts::FRAC_PI_2] {
            let latent = sample(&SunRequest { elevation: Some(elevation), ..SunRequest::default() });
            latent.check_finite().unwrap();
            assert!(latent.lights.sun().unwrap().elevation() > 0.0);
        }
    }
}

/// Codes drawn under a condition are distributed as those codes of the prior that happen to fulfil it.
#[test]
fn conditioned_codes_are_those_that_happen_to_fulfil_it() {
    let truth = truth();
    let request = SunRequest { elevation: Some(0.6), ..SunRequest::default() };
    let asked: Vec<_> = (0..4000).map(|seed| asked(&request, seed)).collect();
    let near = |latent: &Latent| latent.lights.sun().is_some_and(|sun| (sun.elevation() - 0.6).abs() < 0.05);
    let happened: Vec<_> = (0..40_000).map(|seed| Latent::from_seed(&truth, seed)).filter(near).collect();
    assert!(happened.len() > 1000);
    let statistics = |codes: &[Latent]| {
        let mean = |value: &dyn Fn(&Latent) -> f64| codes.iter().map(value).sum::<f64>() / codes.len() as f64;
        let z = |code: &Latent| f64::from(code.vectors[0][2]);
        let e = |code: &Latent| f64::from(crate::light::luminance(code.lights[0].irradiance)).ln();
        [
            mean(&z),
            mean(&|code| z(code).powi(2)),
            mean(&e),
            mean(&|code| e(code).powi(2)),
            mean(&|code| z(code) * e(code)),
        ]
    };
    for (a, b) in statistics(&asked).into_iter().zip(statistics(&happened)) {
        assert!((a - b).abs() < 0.05, "{a} {b}");
    }
}

/// Another azimuth moves the vectors that the sun depends on, and no others.
#[test]
fn another_azimuth_is_the_same_place() {
    for seed in 0..50 {
        let sample = |azimuth| {
            let request = SunRequest { azimuth: Some(azimuth), ..SunRequest::default() };
            asked(&request, seed)
        };
        let (a, b) = (sample(0.5), sample(2.5));
        assert!((heading(&a) - 0.5).abs() < 1e-5 && (heading(&b) - 2.5).abs() < 1e-5);
        assert_eq!(a.vectors[1], b.vectors[1]);
        assert_ne!(a.vectors[0], b.vectors[0]);
        let of = |latent: &Latent| latent.lights.sun().unwrap().irradiance;
        assert_eq!(of(&a), of(&b));
    }
}

/// Where a code's vectors say a sun is, and where it was drawn.
#[test]
fn the_likely_sun_is_near_the_drawn_one() {
    let truth = truth();
    let (mut right, mut sunny, mut error, mut likely) = (0, 0, 0.0, 0.0);
    for latent in drawn(500) {
        let (chance, guess) = truth.likely_sun(&latent.vectors).unwrap();
        let there = latent.lights.sun();
        right += i32::from((chance > 0.5) == there.is_some());
        likely += chance;
        if let Some(there) = there {
            let apart = f64::from(there.azimuth() - guess.azimuth());
            error += apart.sin().atan2(apart.cos()).abs();
            sunny += 1;
        }
    }
    assert!(right > 375, "{right} of 500");
    assert!((likely - f64::from(sunny)).abs() < 40.0, "{likely} {sunny}");
    assert!(error / f64::from(sunny) < 0.5, "{}", error / f64::from(sunny));
}
