use super::*;
use std::f64::consts::PI;

fn sky(size: [usize; 2]) -> Vec<[f32; 3]> {
    Panorama::from_fn(Equirect::new(size[0], size[1]), |[x, y, z]| [2.0 + x, 2.0 + y, 2.0 + z])
        .pixels()
        .to_vec()
}

fn whole(pixels: &[[f32; 3]], size: [usize; 2]) -> Picture {
    Picture::new(size, pixels.to_vec()).unwrap()
}

#[test]
fn a_whole_panorama_is_what_training_sees() {
    let pixels = sky([32, 16]);
    let grid = Equirect::new(16, 8);
    let seen = Observation::panorama(&whole(&pixels, [32, 16]), grid).unwrap();
    let item = veni_data::Item::new(
        std::path::Path::new("sky.exr"),
        &Panorama::new(Equirect::new(32, 16), pixels),
        grid,
    );
    assert!((seen.log_exposure - item.log_exposure).abs() < 1e-5);
    let pairs = seen.log_radiance.iter().zip(item.log_radiance.iter());
    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-5));
    assert!(seen.mask.is_none() && seen.clipped.is_none() && !seen.is_partial());
    assert!((seen.share() - 1.0).abs() < 1e-5);
}

#[test]
fn what_is_unknown_leaves_no_trace() {
    let (size, grid) = ([32, 16], Equirect::new(16, 8));
    let mut pixels = sky(size);
    // the left quarter is missing, in three ways
    let gone = |p: usize| p % 32 < 8;
    for p in (0..512).filter(|p| gone(*p)) {
        pixels[p] = [[f32::NAN; 3], [f32::INFINITY, 1.0, 1.0], [1e9; 3]][p % 3];
    }
    let known: Vec<f32> = (0..512).map(|p| if gone(p) && p % 3 == 2 { 0.0 } else { 1.0 }).collect();
    let seen = Observation::panorama(&whole(&pixels, size).masked(&known).unwrap(), grid).unwrap();
    let mask = seen.mask.as_ref().unwrap();
    let truth = Observation::panorama(&whole(&sky(size), size), grid).unwrap();
    for (p, known) in mask.iter().enumerate() {
        assert_eq!(*known > 0.0, p % 16 >= 4, "{p}");
        for c in 0..3 {
            let (a, b) = (
                seen.log_radiance[3 * p + c] + seen.log_exposure,
                truth.log_radiance[3 * p + c] + truth.log_exposure,
            );
            assert!(*known == 0.0 || (a - b).abs() < 1e-4, "{p}: {a} {b}");
        }
    }
    assert!((seen.share() - 0.75).abs() < 1e-4 && seen.is_partial());
}

#[test]
fn a_photograph_sees_what_the_panorama_has_there() {
    let view = View { fov: 1.2, azimuth: 0.8, elevation: 0.2, roll: 0.0 };
    let light = |[x, y, z]: [f32; 3]| [2.0 + x, 2.0 + y, 2.0 + z];
    let (directions, _) = view.pixels(90, 60);
    let pixels: Vec<_> = directions.into_iter().map(light).collect();
    let seen = Observation::photograph(&whole(&pixels, [90, 60]).clipped_at(2.9), &view, 45).unwrap();
    assert_eq!((seen.grid.width, seen.grid.height), (45, 30));
    let Perspective { directions, areas, .. } = seen.perspective.as_ref().unwrap();
    let covered = areas.iter().sum::<f32>() / (4.0 * PI as f32);
    assert!((seen.share() - covered).abs() < 1e-6);
    let clipped = seen.clipped.as_ref().unwrap();
    for (p, d) in directions.iter().enumerate() {
        for (c, expected) in light(*d).into_iter().enumerate() {
            let found = (seen.log_radiance[3 * p + c] + seen.log_exposure).exp();
            assert!((found - expected).abs() < 2e-3, "{p}: {found} {expected}");
            assert!(clipped[3 * p + c] || expected < 2.92);
            assert!(!clipped[3 * p + c] || expected > 2.88);
        }
    }
}

#[test]
fn what_cannot_be_seen_is_refused() {
    let pixels = vec![[0.0; 3]; 8];
    let message =
        |picture: &Picture| Observation::panorama(picture, Equirect::new(4, 2)).unwrap_err().to_string();
    assert!(message(&whole(&pixels, [4, 2])).contains("no known pixel"));
    assert!(message(&whole(&pixels, [2, 4])).contains("twice its height"));
    let view = View { fov: PI, azimuth: 0.0, elevation: 0.0, roll: 0.0 };
    let wide = Observation::photograph(&whole(&pixels, [4, 2]), &view, 64).unwrap_err().to_string();
    assert!(wide.contains("180"), "{wide}");
}

/// Radiance as it is fitted.
fn values(seen: &Observation) -> Vec<f32> {
    seen.log_radiance.iter().map(|v| (v + seen.log_exposure).exp()).collect()
}

#[test]
fn black_is_known_to_be_dark() {
    let (size, grid) = ([16, 8], Equirect::new(16, 8));
    // a lamp of 10 over an eighth of the pixels, black elsewhere, and below black
    let mut pixels = vec![[0.0f32, -3.0, 0.0]; 128];
    (0..128).filter(|p| p % 16 < 2).for_each(|p| pixels[p] = [10.0; 3]);
    let seen = Observation::panorama(&whole(&pixels, size), grid).unwrap();
    assert!(seen.mask.is_none() && (seen.share() - 1.0).abs() < 1e-5, "all of it is known");
    // 10⁻⁴ of the mean of 10/8
    for (p, found) in values(&seen).iter().enumerate() {
        let expected = if p / 3 % 16 < 2 { 10.0 } else { 1.25e-4 };
        assert!((found / expected - 1.0).abs() < 1e-4, "{p}: {found} {expected}");
    }
    // what is unknown has no say in that
    let mask: Vec<f32> = (0..128).map(|p| f32::from(u8::from(p % 16 < 8))).collect();
    let half = Observation::panorama(&whole(&pixels, size).masked(&mask).unwrap(), grid).unwrap();
    assert!((values(&half)[3 * 5] / 2.5e-4 - 1.0).abs() < 1e-4, "{}", values(&half)[3 * 5]);
    // a darker value of the picture's own is the darkest
    pixels[5] = [1e-5; 3];
    let seen = Observation::panorama(&whole(&pixels, size), grid).unwrap();
    assert!((values(&seen)[3 * 9] / 1e-5 - 1.0).abs() < 1e-4, "{}", values(&seen)[3 * 9]);
    // in any unit of radiance that has logarithms
    for pixel in &mut pixels {
        *pixel = pixel.map(|v| v * 1e-32);
    }
    assert!(Observation::panorama(&whole(&pixels, size), grid).unwrap().log_exposure.is_finite());
}

#[test]
fn the_black_of_a_photograph_is_the_first_step_of_its_values_at_most() {
    let view = View { fov: 1.0, azimuth: 0.0, elevation: 0.0, roll: 0.0 };
    let first = 1.0 / (255.0 * 12.92f32);
    let darkest = |grey: f32| {
        // half of it black, but for single pixels of one step, which are noise
        let mut pixels = vec![[grey; 3]; 64];
        pixels[..32].fill([0.0; 3]);
        pixels[0] = [first; 3];
        let seen = Observation::photograph(&whole(&pixels, [8, 8]).clipped_at(0.991), &view, 4).unwrap();
        assert!(seen.mask.is_none(), "all of it is known");
        values(&seen)
    };
    // bright or dark, and whether noise is mixed into a cell or not
    for grey in [0.9, 0.01] {
        let found = darkest(grey);
        for v in [found[0], found[3]] {
            assert!((v / first - 1.0).abs() < 0.02, "{v} for {first}");
        }
        assert!((found[3 * 15] / grey - 1.0).abs() < 1e-4);
    }
    // values of 16 bits are smaller than that step
    let mut pixels = vec![[0.5; 3]; 64];
    pixels[..32].fill([0.0; 3]);
    pixels[32] = [1e-6; 3];
    let seen = Observation::photograph(&whole(&pixels, [8, 8]).clipped_at(0.991), &view, 8).unwrap();
    assert!((values(&seen)[0] / 1e-6 - 1.0).abs() < 1e-4, "{}", values(&seen)[0]);
}
