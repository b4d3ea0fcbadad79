use std::f32::consts::PI;

use super::*;
use veni_image::Panorama;
use veni_light::model::Model;
use veni_light::sphere::View;

const SKY: Equirect = Equirect { width: 128, height: 64 };

/// A sky over ground with a sun of irradiance 8 at this azimuth, degrees, 37° high.
fn sunny(azimuth: f32) -> Vec<[f32; 3]> {
    let below = |d: [f32; 3]| if d[2] < 0.0 { [0.2; 3] } else { [0.5, 0.7, 1.0] };
    let mut pixels = Panorama::from_fn(SKY, below).into_pixels();
    let (sin, cos) = azimuth.to_radians().sin_cos();
    CompactLight::new([0.8 * cos, 0.8 * sin, 0.6], [8.0; 3], CompactLight::SUN_RADIUS)
        .add_to(SKY, &mut pixels);
    pixels
}

/// Half of it, where columns are counted from azimuth 180° towards 0°: 1 on the right.
fn half() -> Vec<f32> {
    (0..SKY.len()).map(|p| f32::from(u8::from(p % 128 >= 64))).collect()
}

#[test]
fn a_sun_in_the_known_half_is_taken_out_and_one_in_the_other_half_is_not_seen() {
    let size = [128, 64];
    let picture = |azimuth: f32| Picture::new(size, sunny(azimuth)).unwrap().masked(&half()).unwrap();
    // the right half looks to azimuths below 0
    let (rest, lights) = seen_lights(&picture(-60.0), 1, PI).unwrap();
    let sun = lights.sun().unwrap();
    assert!((sun.azimuth().to_degrees() + 60.0).abs() < 2.0, "{sun:?}");
    assert!((sun.irradiance[1] - 8.0).abs() < 0.4, "{sun:?}");
    let brightest = rest.pixels().iter().flatten().copied().fold(0.0, f32::max);
    assert!(brightest < 2.0 && rest.known() == Some(&half()[..]), "{brightest}");

    let (_, lights) = seen_lights(&picture(60.0), 1, PI).unwrap();
    assert!(lights.is_empty(), "{lights:?}");
    // what is not known may be anything
    let mut pixels = sunny(60.0);
    pixels.iter_mut().zip(half()).filter(|(_, k)| *k == 0.0).for_each(|(p, _)| *p = [f32::NAN; 3]);
    assert!(seen_lights(&Picture::new(size, pixels).unwrap(), 1, PI).unwrap().1.is_empty());

    let whole = seen_lights(&Picture::new(size, sunny(60.0)).unwrap(), 1, PI).unwrap();
    assert!(whole.1.sun().is_some() && whole.0.known().is_none());
    let dark = Picture::new(size, sunny(0.0)).unwrap().masked(&vec![0.0; SKY.len()]).unwrap();
    assert!(seen_lights(&dark, 1, PI).unwrap_err().to_string().contains("no known pixel"));
    let square = Picture::new([2, 2], vec![[1.0; 3]; 4]).unwrap();
    assert!(seen_lights(&square, 1, PI).unwrap_err().to_string().contains("2 × 2"));
}

#[test]
fn a_sun_is_likely_only_where_nothing_is_seen() {
    let model = Model::pretrained();
    let prior = model.prior();
    // a sky that has a sun by its vectors
    let likely = |seed| {
        let latent = Latent::from_seed(&prior, seed);
        let (chance, sun) = prior.likely_sun(&latent.vectors).unwrap();
        (chance > 0.6 && sun.elevation() < 0.6).then_some((latent, sun))
    };
    let (latent, sun) = (0..200).find_map(likely).unwrap();
    let observed = |azimuth: f64| {
        let view = View { fov: 1.5, azimuth, elevation: f64::from(sun.elevation()), roll: 0.0 };
        Observation::photograph(&Picture::new([8, 8], vec![[0.5; 3]; 64]).unwrap(), &view, LONGEST).unwrap()
    };
    let towards = f64::from(sun.azimuth());
    assert!(likely_sun(&prior, &latent, &observed(towards)).is_none());
    let (_, found) = likely_sun(&prior, &latent, &observed(towards + std::f64::consts::PI)).unwrap();
    assert_eq!(found.direction, sun.direction);
    // of a panorama, where its mask is
    let grey = |known: f32| {
        let mut mask = vec![1.0 - known; SKY.len()];
        let [column, row] = SKY.pixel(sun.direction).map(|v| v as usize);
        for (y, x) in (0..SKY.height).flat_map(|y| (0..SKY.width).map(move |x| (y, x))) {
            if y.abs_diff(row) < 6 && x.abs_diff(column) < 6 {
                mask[y * SKY.width + x] = known;
            }
        }
        let picture = Picture::new([SKY.width, SKY.height], vec![[0.5; 3]; SKY.len()]).unwrap();
        Observation::panorama(&picture.masked(&mask).unwrap(), GRID).unwrap()
    };
    assert!(likely_sun(&prior, &latent, &grey(1.0)).is_none());
    assert!(likely_sun(&prior, &latent, &grey(0.0)).is_some());
}

#[test]
fn starts_are_zero_and_draws_of_the_prior() {
    let prior = Prior::standard(4);
    let all = starts(&prior, 3);
    assert_eq!((all.len(), &all[0].vectors), (STARTS, &vec![[0.0; 3]; 4]));
    assert!(all[1..].iter().all(|z| z.vectors != all[0].vectors) && all[1] != all[2]);
    assert_ne!(starts(&prior, 4)[1], all[1]);
    // the less is known, the more the prior weighs; of the whole sphere as little as it may
    assert!(prior_weight(0.07) > 6.0 * prior_weight(0.5) && (prior_weight(0.5) - 0.02).abs() < 1e-9);
    assert!(prior_weight(0.0) <= 1.0);
    config(0.1).check().unwrap();
}

#[test]
fn black_between_lamps_is_dark_beside_them() {
    let size = [128, 64];
    let lamps = |rest: f32| {
        let mut pixels = vec![[rest; 3]; SKY.len()];
        for (x, y, radius) in [(20, 20, 3), (64, 40, 4), (100, 28, 2)] {
            for (j, i) in (y - radius..y + radius).flat_map(|j| (x - radius..x + radius).map(move |i| (j, i)))
            {
                pixels[j * 128 + i] = [4.0, 7.0, 10.0];
            }
        }
        pixels
    };
    let picture = Picture::new(size, lamps(0.0)).unwrap();
    let weights: Vec<f64> = (0..SKY.len()).map(|p| SKY.solid_angle(p / 128)).collect();
    let mean = black::mean(&lamps(0.0), &weights) as f32;
    let (rest, lights) = seen_lights(&picture, 4, PI).unwrap();
    assert_eq!(lights.len(), 3);
    let seen = Observation::panorama(&rest, GRID).unwrap();
    assert!((seen.log_exposure() - (1e-4 * mean).ln()).abs() < 1e-4, "{}", seen.log_exposure());
    assert!(!seen.is_partial());
    // without lights to be taken out, nothing is left to be seen
    let (rest, lights) = seen_lights(&Picture::new(size, vec![[0.0; 3]; SKY.len()]).unwrap(), 4, PI).unwrap();
    assert!(lights.is_empty());
    assert!(Observation::panorama(&rest, GRID).unwrap_err().to_string().contains("no known pixel"));
}
