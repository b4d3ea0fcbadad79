use super::*;
#[cfg(feature = "pretrained")]
use crate::light::EnvironmentMap;
#[cfg(feature = "pretrained")]
use crate::model::Model;
#[cfg(feature = "pretrained")]
use crate::sphere::Equirect;

/// The model inside this crate with suns that follow its vectors.
#[cfg(feature = "pretrained")]
fn ready() -> (Decoder, Prior) {
    let model = Model::pretrained();
    let prior = model.prior();
    assert!(prior.sun().is_some(), "the model inside knows of suns");
    (model.decoder().unwrap(), prior)
}

#[cfg(feature = "pretrained")]
fn measured(decoder: &Decoder, latent: &Latent) -> SkyMeasures {
    let grid = Equirect::new(512, 256);
    let pixels = decoder.condition(latent).unwrap().bake(grid);
    SkyMeasures::of(&Light::of(EnvironmentMap::new(grid, &pixels).unwrap()))
}

/// What is asked is measured in the pixels, within 2° and 10 %.
#[cfg(feature = "pretrained")]
#[test]
fn what_is_asked_is_measured() {
    let (decoder, prior) = ready();
    for (seed, sun, overcast, kelvin) in [
        (1, [2.0, 0.6], 0.2, 6500.0),
        (2, [-1.0, 0.15], 0.5, 4500.0),
        (3, [0.3, 1.2], 0.15, 5600.0),
        (4, [3.0, 0.9], 0.8, 7500.0),
    ] {
        let request = SkyRequest {
            sun: SunRequest { azimuth: Some(sun[0]), elevation: Some(sun[1]), ..SunRequest::default() },
            overcast: Some(overcast),
            temperature: Some(kelvin),
        };
        let latent = request.draw(&decoder, &prior, &mut Stream::from_seed(seed)).unwrap();
        let came = measured(&decoder, &latent);
        let [azimuth, elevation] =
            came.sun.unwrap_or_else(|| panic!("seed {seed}: {came:?} {:?}", latent.lights));
        let apart = ((azimuth - sun[0]).sin() * sun[1].cos()).hypot(elevation - sun[1]);
        assert!(apart < 2f64.to_radians(), "seed {seed}: {came:?}");
        assert!((came.overcast / overcast - 1.0).abs() < 0.1, "seed {seed}: {came:?}");
        assert!((came.temperature.unwrap_or(0.0) / kelvin - 1.0).abs() < 0.1, "seed {seed}: {came:?}");
    }
}

#[cfg(feature = "pretrained")]
#[test]
fn without_a_sun_there_is_none() {
    let (decoder, prior) = ready();
    for seed in 0..8 {
        let request = SkyRequest { overcast: Some(1.0), ..SkyRequest::default() };
        let latent = request.draw(&decoder, &prior, &mut Stream::from_seed(seed)).unwrap();
        assert!(latent.lights.is_empty(), "seed {seed}");
    }
}

/// A sun on its way moves the place without jumps.
#[cfg(feature = "pretrained")]
#[test]
fn a_moving_sun_makes_no_jumps() {
    let (decoder, prior) = ready();
    let at = |t: f64| {
        let sun =
            SunRequest { azimuth: Some(2.0 - 4.0 * t), elevation: Some(0.02 + t), ..SunRequest::default() };
        let request = SkyRequest { sun, ..SkyRequest::default() };
        request.draw(&decoder, &prior, &mut Stream::from_seed(5)).unwrap()
    };
    let frames: Vec<_> = (0..=50).map(|k| at(f64::from(k) / 50.0)).collect();
    let step = |a: &Latent, b: &Latent| {
        let pairs = a.vectors.as_flattened().iter().zip(b.vectors.as_flattened());
        pairs.map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt()
    };
    let steps: Vec<_> = frames.windows(2).map(|pair| step(&pair[0], &pair[1])).collect();
    let (least, most) = steps.iter().fold((f32::MAX, 0f32), |(a, b), s| (a.min(*s), b.max(*s)));
    assert!(most < 0.3 && least > 0.0, "{steps:?}");
}

#[test]
fn requests_that_make_no_sense_are_refused() {
    let refused = |change: &dyn Fn(&mut SkyRequest)| {
        let mut request = SkyRequest::default();
        change(&mut request);
        request.checked().unwrap_err().to_string()
    };
    assert!(refused(&|r| r.sun.elevation = Some(-0.1)).contains("-5.73"));
    assert!(refused(&|r| r.sun.elevation = Some(f64::NAN)).contains("elevation"));
    assert!(refused(&|r| r.sun.azimuth = Some(f64::INFINITY)).contains("azimuth"));
    assert!(refused(&|r| (r.sun.elevation, r.sun.present) = (Some(0.3), Some(false))).contains("no sun"));
    assert!(refused(&|r| r.overcast = Some(0.0)).contains("0.02"));
    assert!(refused(&|r| (r.overcast, r.sun.azimuth) = (Some(1.0), Some(0.0))).contains("exclude"));
    assert!(refused(&|r| (r.overcast, r.sun.present) = (Some(0.3), Some(false))).contains("exclude"));
    assert!(refused(&|r| r.temperature = Some(500.0)).contains("2000"));
    let implied = SkyRequest { overcast: Some(0.99), ..SkyRequest::default() }.checked().unwrap();
    assert_eq!((implied.sun.present, implied.overcast), (Some(false), None));
}
