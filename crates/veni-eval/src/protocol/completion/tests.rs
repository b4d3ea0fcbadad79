use super::*;

const GRID: Equirect = Equirect { width: 128, height: 64 };

#[test]
fn half_as_bright_below_has_these_scores() {
    let truth = vec![2f32.ln(); 3 * GRID.len()];
    let decoded = vec![0.0; 3 * GRID.len()];
    let whole = completed(GRID, Half::Lower, &truth, &decoded);
    let scored = score(GRID, Half::Lower, &whole, &truth).unwrap();
    // sRGB of ½ is 0.735357; ln 2 is the range and the error
    assert!((scored.ldr_psnr - 11.5468).abs() < 1e-3, "{scored:?}");
    assert!((scored.ssim - 0.954_544).abs() < 1e-5, "{scored:?}");
    assert!(scored.log_psnr.abs() < 1e-5, "{scored:?}");
    // of a surface whose normal is z high, (1 + z)/2 + (1 − z)/4 of the light is left
    assert!((scored.lit.error - EXPECTED[0]).abs() < 2e-3, "{scored:?}");
    assert!((scored.lit.aligned - EXPECTED[1]).abs() < 2e-3, "{scored:?}");
    let same = score(GRID, Half::Left, &truth, &truth).unwrap();
    assert!(same.log_psnr.is_infinite() && same.ssim == 1.0 && same.lit.error < 1e-9, "{same:?}");
}

/// Error, and aligned.
const EXPECTED: [f64; 2] = [0.364_796, 0.197_338];

#[test]
fn what_is_hidden_is_left_or_below() {
    let count = |half: Half| (0..GRID.len()).filter(|p| half.hides(GRID, *p)).count();
    for half in Half::ALL {
        let [height, width] = half.shape(GRID);
        assert_eq!((count(half), height * width), (GRID.len() / 2, GRID.len() / 2));
    }
    assert!(Half::Left.hides(GRID, 63) && !Half::Left.hides(GRID, 64));
    assert!(!Half::Lower.hides(GRID, 31 * 128 + 127) && Half::Lower.hides(GRID, 32 * 128));
    let odd = Equirect::new(26, 13);
    let [height, width] = Half::Lower.shape(odd);
    assert_eq!((0..odd.len()).filter(|p| Half::Lower.hides(odd, *p)).count(), height * width);
}

#[test]
fn suns_count_where_they_were_hidden() {
    let sky = |suns: &[(f32, f32)]| {
        let below = |d: &[f32; 3]| if d[2] < 0.0 { [0.2; 3] } else { [0.5, 0.7, 1.0] };
        let mut pixels: Vec<_> = GRID.directions().iter().map(below).collect();
        for (azimuth, irradiance) in suns {
            let (sin, cos) = azimuth.to_radians().sin_cos();
            let sun =
                CompactLight::new([0.8 * cos, 0.8 * sin, 0.6], [*irradiance; 3], CompactLight::SUN_RADIUS);
            sun.add_to(GRID, &mut pixels);
        }
        pixels.into_flattened().into_iter().map(f32::ln).collect::<Vec<_>>()
    };
    // azimuths above 0 are on the left
    let became = |whole: &[(f32, f32)], truth: &[(f32, f32)]| {
        hidden_sun(GRID, Half::Left, &sky(whole), &sky(truth)).unwrap()
    };
    assert_eq!(became(&[], &[(60.0, 8.0)]), Sun::Missed);
    assert_eq!(became(&[(60.0, 8.0)], &[]), Sun::False);
    assert_eq!(became(&[(-60.0, 8.0)], &[(-60.0, 8.0)]), Sun::None);
    assert_eq!(became(&[(-60.0, 8.0), (60.0, 40.0)], &[(-60.0, 8.0)]), Sun::False);
    let moved = became(&[(70.0, 16.0)], &[(60.0, 8.0)]);
    assert!(
        matches!(moved, Sun::Both { degrees, irradiance } if (degrees - 8.0).abs() < 2.0 && (irradiance - 0.693).abs() < 0.1),
        "{moved:?}"
    );
}

#[test]
fn the_mean_sky_has_the_exposure_of_what_is_seen() {
    let panorama = veni_image::Panorama::from_fn(GRID, |d| if d[2] > 0.0 { [3.0; 3] } else { [0.5; 3] });
    let item = Item::new(std::path::Path::new("sky.exr"), &panorama, GRID);
    let sky = exposed(GRID, Half::Lower, &item, &vec![1.0; 3 * GRID.len()]);
    // the upper half, at exposure 0: ½ ln 6
    assert!(sky.iter().all(|v| (v - 0.5 * 6f32.ln()).abs() < 1e-5), "{}", sky[0]);
}
