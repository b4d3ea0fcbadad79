//! What the encoder sees of a panorama: directions, order, and what rotating and rolling do.

use std::f64::consts::PI;

use veni_image::Panorama;
use veni_light::sphere::{Equirect, StripeSampling, Stripes};

fn sky(width: usize, height: usize) -> Panorama {
    Panorama::from_fn(Equirect::new(width, height), |[x, y, z]| {
        [(3.0 * x - y).exp(), (2.0 * y + x * z).sin() + 1.5, 1.1 + z - x * y]
    })
}

#[test]
fn sizes_that_fit_and_sizes_that_do_not() {
    for (t, p) in [(64, 512), (64, 32), (8, 16), (32, 256), (1, 2), (128, 256)] {
        let stripes = Stripes::new(t, p, StripeSampling::Exact).unwrap();
        let d = stripes.directions();
        assert_eq!(d.len(), t * p);
        assert!(d.iter().all(|d| (d.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-6));
    }
    for (t, p) in [(0, 8), (64, 511), (64, 64), (9, 8), (usize::MAX, 2)] {
        let error = Stripes::new(t, p, StripeSampling::Exact).unwrap_err().to_string();
        assert!(error.contains(&format!("{t} stripes of {p}")), "{error}");
    }
}

#[test]
fn samples_agree_with_their_directions() {
    for sampling in [StripeSampling::Exact, StripeSampling::Reference] {
        let stripes = Stripes::new(16, 128, sampling).unwrap();
        let image = sky(512, 256);
        let seen = stripes.sample(image.pixels(), image.grid());
        let mut worst = 0f32;
        for (d, pixel) in stripes.directions().into_iter().zip(seen) {
            // at the poles the reference's lookup takes an arbitrary column
            if d[2].abs() < 0.999 {
                let expected = Panorama::from_fn(Equirect::new(1, 1), |_| {
                    let [x, y, z] = d;
                    [(3.0 * x - y).exp(), (2.0 * y + x * z).sin() + 1.5, 1.1 + z - x * y]
                });
                for (a, b) in pixel.iter().zip(expected.pixel(0, 0)) {
                    worst = worst.max((a - b).abs());
                }
            }
        }
        // within bilinear error for the exact grid; half a pixel at the unwrapped seam for the other
        assert!(worst < if sampling == StripeSampling::Exact { 4e-3 } else { 3e-2 }, "{sampling:?}: {worst}");
    }
}

#[test]
fn order_is_azimuth_then_height() {
    for sampling in [StripeSampling::Exact, StripeSampling::Reference] {
        let stripes = Stripes::new(8, 16, sampling).unwrap();
        let d = stripes.directions();
        // h = 8, w = 16: two meridians per stripe; heights increase
        assert!(d[..8].windows(2).all(|pair| pair[0][2] < pair[1][2]), "{sampling:?}");
        assert!(d[8..16].windows(2).all(|pair| pair[0][2] < pair[1][2]));
        let azimuth = |k: usize| d[8 * k + 4][1].atan2(d[8 * k + 4][0]);
        for k in 1..16 {
            let step = (azimuth(k) - azimuth(k - 1)).rem_euclid(2.0 * std::f32::consts::PI);
            assert!(step > 0.3 && step < 0.5, "{sampling:?}: {step}");
        }
        // the first meridian is near +y
        assert!(d[4][1] > 0.9);
    }
}

#[test]
fn rolling_by_whole_stripes_permutes_bit_for_bit() {
    let (t, p) = (16, 128);
    let stripes = Stripes::new(t, p, StripeSampling::Exact).unwrap();
    for width in [16, 48, 128, 400] {
        let image = sky(width, width / 2);
        let seen = stripes.sample(image.pixels(), image.grid());
        for k in [1, 3, 15] {
            let rolled = image.rotated(2.0 * PI * k as f64 / t as f64);
            let other = stripes.sample(rolled.pixels(), image.grid());
            // rotated by k stripes: what stripe p saw is now seen by stripe p + k
            let expected: Vec<_> = (0..t).flat_map(|q| seen[(q + t - k) % t * p..][..p].to_vec()).collect();
            assert!(other == expected, "width {width}, {k} stripes");
        }
    }
}

#[test]
fn rotating_the_grid_is_rotating_the_panorama() {
    let image = sky(128, 64);
    for sampling in [StripeSampling::Exact, StripeSampling::Reference] {
        let stripes = Stripes::new(16, 128, sampling).unwrap();
        for columns in [1, 32, 100] {
            let yaw = 2.0 * PI * f64::from(columns) / 128.0;
            let rotated = image.rotated(yaw);
            let a = stripes.gather_rotated(image.grid(), yaw).sample(image.pixels());
            let b = stripes.sample(rotated.pixels(), image.grid());
            let seam = |[x, y, z]: [f32; 3], yaw: f32| {
                let (sin, cos) = yaw.sin_cos();
                z.abs() > 0.99 || cos * x + sin * y < -0.95 * (1.0 - z * z).sqrt()
            };
            let mut compared = 0;
            for ((a, b), d) in a.iter().zip(&b).zip(stripes.directions()) {
                // the unwrapped seam and the poles of the reference's lookup do not rotate with the grid
                if sampling == StripeSampling::Reference && (seam(d, 0.0) || seam(d, yaw as f32)) {
                    continue;
                }
                compared += 1;
                assert!(
                    a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-4),
                    "{sampling:?} {d:?}: {a:?} {b:?}"
                );
            }
            assert!(compared > 1400, "{sampling:?}: {compared}");
        }
    }
}
