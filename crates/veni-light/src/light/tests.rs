//! Lights put in are found again; what is not a light is left alone.

use std::f32::consts::PI;

use super::*;
use crate::latent::{Latent, Lobe};
use crate::model::{Model, ModelConfig};
use crate::sphere::Equirect;

fn direction(azimuth: f32, elevation: f32) -> [f32; 3] {
    let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    [ce * ca, ce * sa, se]
}

fn degrees(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (a, b) = (a.map(f64::from), b.map(f64::from));
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    cross.iter().map(|c| c * c).sum::<f64>().sqrt().atan2(dot).to_degrees() as f32
}

fn disc(direction: [f32; 3], degrees: f32, irradiance: [f32; 3]) -> CompactLight {
    CompactLight::new(direction, irradiance, degrees.to_radians())
}

/// A sky brighter at the horizon over a dark ground, with these lights.
fn scene(grid: Equirect, lights: &[CompactLight]) -> Vec<[f32; 3]> {
    let sky = |[_, _, z]: [f32; 3]| {
        if z > 0.0 { [0.2, 0.3, 0.5].map(|v| v * (1.5 - z)) } else { [0.12, 0.1, 0.08] }
    };
    let mut pixels: Vec<_> = grid.directions().into_iter().map(sky).collect();
    lights.iter().for_each(|light| light.add_to(grid, &mut pixels));
    pixels
}

fn light_of(grid: Equirect, pixels: &[[f32; 3]]) -> Light {
    let map = EnvironmentMap::new(grid, pixels).unwrap();
    let light = Light::of(map);
    let sum = light.residual().integral();
    for (c, total) in map.integral().into_iter().enumerate() {
        let with: f64 = sum[c] + light.lights().iter().map(|l| f64::from(l.irradiance[c])).sum::<f64>();
        assert!((with / total - 1.0).abs() < 1e-6, "the energy of channel {c} is {with}, not {total}");
    }
    light
}

#[test]
fn discs_are_found_at_any_size_elevation_and_resolution() {
    for (width, sizes) in [(256, &[1.0, 3.0][..]), (1024, &[0.2665, 0.5, 3.0]), (2048, &[0.2665, 1.0])] {
        let grid = Equirect::new(width, width / 2);
        let pixel = 360.0 / width as f32;
        for &radius in sizes {
            for (azimuth, elevation) in
                [(33.3, 71.0), (-150.0, 41.3), (100.2, 21.7), (179.95, 35.0), (10.0, 89.9), (-60.0, 4.0)]
            {
                let irradiance = [8.0, 6.0, 3.0];
                let put = disc(direction(azimuth, elevation), radius, irradiance);
                let light = light_of(grid, &scene(grid, &[put]));
                let what = format!("{width} wide, {radius}° at {azimuth}°, {elevation}°");
                let sun = light.sun().unwrap_or_else(|| panic!("{what}: no sun among {:?}", light.lights()));
                let off = degrees(sun.direction, put.direction);
                assert!(off <= 0.25 * pixel, "{what}: {off}° off, a pixel is {pixel}°");
                for (found, given) in sun.irradiance.iter().zip(irradiance) {
                    let ratio = found / given;
                    assert!((ratio - 1.0).abs() < 0.01, "{what}: irradiance {:?}", sun.irradiance);
                }
                if radius > 1.5 * pixel {
                    assert_eq!(sun.radius_source, RadiusSource::Measured, "{what}");
                    assert!(
                        (sun.radius.to_degrees() / radius - 1.0).abs() < 0.05,
                        "{what}: {}",
                        sun.radius.to_degrees()
                    );
                } else if radius < 0.8 * pixel {
                    assert_eq!(sun.radius_source, RadiusSource::Assumed, "{what}");
                }
                assert_eq!(sun.kind(), Kind::of(sun.radius));
                assert!(!sun.clipped, "{what}");
                assert_eq!(light.lights().len(), 1, "{what}: {:?}", light.lights());
            }
        }
    }
}

#[test]
fn a_sun_cut_in_half_by_the_horizon_is_what_is_seen_of_it() {
    let grid = Equirect::new(2048, 1024);
    let whole = disc(direction(40.0, 0.0), 1.0, [8.0, 6.0, 3.0]);
    let mut pixels = scene(grid, &[whole]);
    let ground = scene(grid, &[]);
    // what is below the horizon is hidden
    pixels[512 * 2048..].copy_from_slice(&ground[512 * 2048..]);
    let light = light_of(grid, &pixels);
    let sun = light.sun().expect("half a sun is one");
    assert!((sun.irradiance[0] / 4.0 - 1.0).abs() < 0.01, "{:?}", sun.irradiance);
    // the centroid of half a disc lies 4r/3π above its diameter
    let expected = 4.0 / (3.0 * PI);
    assert!((sun.elevation().to_degrees() - expected).abs() < 0.05, "{}", sun.elevation().to_degrees());
}

#[test]
fn two_suns_are_two_lights_and_the_stronger_is_the_sun() {
    let grid = Equirect::new(1024, 512);
    let put = [
        disc(direction(-20.0, 30.0), 0.5, [4.0, 3.6, 3.0]),
        disc(direction(140.0, 15.0), 0.5, [8.0, 7.0, 6.0]),
    ];
    let light = light_of(grid, &scene(grid, &put));
    assert_eq!(light.lights().len(), 2, "{:?}", light.lights());
    for (found, put) in light.lights().iter().zip([&put[1], &put[0]]) {
        assert!(degrees(found.direction, put.direction) < 0.1, "{found:?}");
        assert!((found.irradiance[1] / put.irradiance[1] - 1.0).abs() < 0.01, "{found:?}");
    }
    assert_eq!(light.sun(), light.lights().first());
}

#[test]
fn fewer_lights_are_the_first_of_all_and_the_rest_is_put_back() {
    let grid = Equirect::new(512, 256);
    // within each other's caps: a sun, its wide glow, and a lamp in the glow
    let put = [
        disc(direction(30.0, 40.0), 0.8, [4.0, 3.6, 3.0]),
        disc(direction(34.0, 43.0), 12.0, [1.5, 1.4, 1.2]),
        disc(direction(20.0, 36.0), 1.0, [0.6, 0.7, 0.9]),
        disc(direction(-140.0, 10.0), 1.5, [0.5, 0.4, 0.2]),
    ];
    let pixels = scene(grid, &put);
    let all = light_of(grid, &pixels);
    assert!(all.lights().len() >= 3 && all.sun().is_some(), "{:?}", all.lights());
    let map = EnvironmentMap::new(grid, &pixels).unwrap();
    for lights in 0..all.lights().len() {
        let fewer = LightOptions { lights, ..LightOptions::default() }.of(map).unwrap();
        assert_eq!(fewer.lights()[..], all.lights()[..lights]);
        assert_eq!(fewer.sun(), all.sun().filter(|_| lights > 0));
        for (c, total) in map.integral().into_iter().enumerate() {
            let lights: f64 = fewer.lights().iter().map(|l| f64::from(l.irradiance[c])).sum();
            assert!(((fewer.residual().integral()[c] + lights) / total - 1.0).abs() < 1e-6);
        }
        let up = |light: &Light| f64::from(light.irradiance([0.0, 0.0, 1.0])[1]);
        assert!((up(&fewer) / up(&all) - 1.0).abs() < 5e-3, "the coarse map is that of what is left");
        if lights == 0 {
            assert!(fewer.residual().pixels() == pixels, "nothing is taken");
        }
    }
}

#[test]
fn parts_are_the_light_that_they_were_parted_from() {
    let grid = Equirect::new(256, 128);
    let pixels = scene(grid, &[disc(direction(50.0, 30.0), 1.0, [6.0, 5.0, 4.0])]);
    let split = light_of(grid, &pixels);
    let again = Light::of_parts(split.residual(), split.sun().copied());
    assert_eq!((again.lights(), again.sun()), (split.lights(), split.sun()));
    assert_eq!(again.irradiance([0.0, 0.6, 0.8]), split.irradiance([0.0, 0.6, 0.8]));
    assert!(again.sh().coefficients() == split.sh().coefficients() && again.mean() == split.mean());
    assert!(Light::of_parts(split.residual(), None).sun().is_none());
}

#[test]
fn lamps_in_a_dark_sky_are_lights_but_no_sun() {
    let grid = Equirect::new(512, 256);
    let lamps: Vec<_> = [(0.0, 20.0), (80.0, 15.0), (170.0, 10.0), (-90.0, 25.0)]
        .map(|(a, e)| disc(direction(a, e), 0.8, [2.0, 1.5, 0.8]))
        .into();
    let mut pixels: Vec<_> =
        grid.directions().into_iter().map(|[_, _, z]| if z > 0.0 { [1e-4; 3] } else { [0.05; 3] }).collect();
    lamps.iter().for_each(|lamp| lamp.add_to(grid, &mut pixels));
    let light = light_of(grid, &pixels);
    assert_eq!(light.lights().len(), 4);
    assert_eq!(light.sun(), None);
    let options = LightOptions { sun: SunChoice::Sky, ..LightOptions::default() };
    assert!(options.of_pixels(grid, pixels).unwrap().sun().is_some(), "asked for, the strongest is the sun");
}

#[test]
fn smooth_and_uniform_maps_have_no_light() {
    let grid = Equirect::new(256, 128);
    for pixels in [vec![[0.7; 3]; grid.len()], vec![[0.0; 3]; grid.len()], scene(grid, &[])] {
        let light = light_of_black(grid, &pixels);
        assert!(light.lights().is_empty(), "{:?}", light.lights());
        assert_eq!(light.residual().pixels(), pixels);
    }
}

fn light_of_black(grid: Equirect, pixels: &[[f32; 3]]) -> Light {
    Light::of(EnvironmentMap::new(grid, pixels).unwrap())
}

#[test]
fn one_bright_pixel_in_the_dark_is_a_light() {
    let grid = Equirect::new(128, 64);
    let mut pixels = vec![[0.0; 3]; grid.len()];
    pixels[20 * 128 + 50] = [1000.0, 500.0, 250.0];
    let light = light_of(grid, &pixels);
    let sun = light.sun().unwrap();
    assert!(degrees(sun.direction, grid.direction(50, 20)) < 1e-3);
    assert!((f64::from(sun.irradiance[0]) / (1000.0 * grid.solid_angle(20)) - 1.0).abs() < 1e-6);
    assert!(light.residual().pixels().iter().flatten().all(|v| *v == 0.0));
    assert!((light.shares()[0] - 1.0).abs() < 1e-3);
}

#[test]
fn a_cut_off_sun_says_so() {
    let grid = Equirect::new(512, 256);
    let mut pixels = scene(grid, &[disc(direction(30.0, 40.0), 4.0, [3.0, 2.8, 2.5])]);
    assert!(!light_of(grid, &pixels).sun().unwrap().clipped);
    // its radiance was 195; 8 bits end at 1, of a sky of 0.2
    pixels.iter_mut().flatten().for_each(|v| *v = (*v * 0.5).min(1.0));
    let light = LightOptions { sun: SunChoice::Sky, contrast: 3.0, ..LightOptions::default() }
        .of_pixels(grid, pixels)
        .unwrap();
    let sun = light.sun().unwrap();
    assert!(sun.clipped && degrees(sun.direction, direction(30.0, 40.0)) < 0.2, "{sun:?}");
    // and one that half precision cut off, however much it outshines the sky
    let mut pixels = scene(grid, &[disc(direction(30.0, 40.0), 1.5, [400.0; 3])]);
    pixels.iter_mut().flatten().for_each(|v| *v = (*v * 1e3).min(65504.0));
    assert!(light_of(grid, &pixels).sun().unwrap().clipped);
}

#[test]
fn a_wide_lobe_is_taken_whole_and_made_a_disc_on_request() {
    let grid = Equirect::new(512, 256);
    let (towards, sigma) = (direction(-70.0, 30.0), 6f32.to_radians());
    let mut pixels = scene(grid, &[]);
    for (pixel, d) in pixels.iter_mut().zip(grid.directions()) {
        let angle = degrees(d, towards).to_radians();
        let glow = 30.0 * (-0.5 * (angle / sigma).powi(2)).exp();
        *pixel = pixel.map(|v| v + glow);
    }
    let light = light_of(grid, &pixels);
    let sun = *light.sun().expect("a lobe counts");
    assert_eq!(sun.kind(), Kind::Lobe);
    assert!(degrees(sun.direction, towards) < 0.5, "{sun:?}");
    let energy = 2.0 * PI * sigma * sigma * 30.0;
    assert!((sun.irradiance[1] / energy - 1.0).abs() < 0.05, "{sun:?} of {energy}");

    let radius = Some(CompactLight::SUN_RADIUS);
    let disc = LightOptions { sun_radius: radius, ..LightOptions::default() }
        .of_pixels(grid, pixels.clone())
        .unwrap();
    let small = *disc.sun().unwrap();
    assert_eq!((small.radius, small.radius_source), (CompactLight::SUN_RADIUS, RadiusSource::Requested));
    assert_eq!(small.irradiance, sun.irradiance);
    let sharp = disc.sharpened();
    let (before, after) =
        (EnvironmentMap::new(grid, &pixels).unwrap(), EnvironmentMap::new(grid, &sharp).unwrap());
    for c in 0..3 {
        assert!((after.integral()[c] / before.integral()[c] - 1.0).abs() < 1e-5);
    }
    let peak = |pixels: &[[f32; 3]]| pixels.iter().map(|p| p[1]).fold(0.0, f32::max);
    assert!(peak(&sharp) > 100.0 * peak(&pixels));
}

#[test]
fn everything_rotates_with_the_map() {
    let grid = Equirect::new(256, 128);
    let pixels = scene(
        grid,
        &[
            disc(direction(33.0, 20.0), 2.0, [9.0, 8.0, 7.0]),
            disc(direction(-80.0, 10.0), 1.5, [3.0, 3.0, 2.0]),
        ],
    );
    let light = light_of(grid, &pixels);
    assert_eq!(light.lights().len(), 2);
    for columns in [1usize, 37, 200] {
        let angle = 2.0 * std::f64::consts::PI * columns as f64 / 256.0;
        let mut moved = pixels.clone();
        moved.chunks_exact_mut(256).for_each(|row| row.rotate_left(columns));
        let (expected, rotated) = (light_of(grid, &moved), light.rotated(angle));
        for (a, b) in expected.lights().iter().zip(rotated.lights().iter()) {
            assert!(degrees(a.direction, b.direction) < 1e-2, "{columns} columns: {a:?} {b:?}");
            assert!(
                (a.irradiance[0] / b.irradiance[0] - 1.0).abs() < 1e-4 && (a.radius - b.radius).abs() < 1e-4
            );
        }
        for n in [[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]] {
            let (a, b) = (expected.irradiance(n), rotated.irradiance(n));
            assert!((a[0] / b[0] - 1.0).abs() < 1e-4, "{a:?} {b:?}");
        }
        let (a, b) = (expected.sh(), rotated.sh());
        let pairs = a.coefficients().as_flattened().iter().zip(b.coefficients().as_flattened());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3));
        let rows = rotated.residual().pixels().iter().zip(expected.residual().pixels());
        let off = rows.map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
        assert!(off < 0.05, "{columns} columns: the residual is {off} off");
    }
    // between columns the energy stays
    let (a, b) = (light.rotated(0.0123).residual().integral(), light.residual().integral());
    assert!((a[0] / b[0] - 1.0).abs() < 1e-6);
}

#[test]
fn irradiance_is_the_sum_over_all_pixels() {
    let grid = Equirect::new(1024, 512);
    let pixels = scene(grid, &[disc(direction(33.0, 40.0), 0.5, [40.0, 30.0, 20.0])]);
    let light = light_of(grid, &pixels);
    for n in [[0.0, 0.0, 1.0], [0.6, 0.8, 0.0], [0.48, -0.6, 0.64], [0.0, 0.0, -1.0]] {
        let mut sum = 0.0;
        for (k, d) in grid.directions().iter().enumerate() {
            let cosine: f32 = d.iter().zip(n).map(|(a, b)| a * b).sum();
            sum += grid.solid_angle(k / 1024) * f64::from(cosine.max(0.0) * pixels[k][0]);
        }
        let found = f64::from(light.irradiance(n)[0]);
        assert!((found / sum - 1.0).abs() < 2e-3, "{n:?}: {found} {sum}");
    }
    let mean = EnvironmentMap::new(grid, &pixels).unwrap().integral()[0] / (4.0 * std::f64::consts::PI);
    assert!((f64::from(light.mean()[0]) / mean - 1.0).abs() < 1e-5);
}

#[test]
fn the_sun_may_be_named_or_left() {
    let grid = Equirect::new(512, 256);
    let put = [disc(direction(-20.0, 30.0), 1.0, [2.0; 3]), disc(direction(140.0, -15.0), 1.0, [9.0; 3])];
    let pixels = scene(grid, &put);
    let with = |sun| LightOptions { sun, ..LightOptions::default() }.of_pixels(grid, pixels.clone()).unwrap();
    let near =
        |light: &Light, k: usize| light.sun().is_some_and(|s| degrees(s.direction, put[k].direction) < 0.1);
    assert!(
        near(&with(SunChoice::Auto), 0) && near(&with(SunChoice::Sky), 0) && near(&with(SunChoice::Any), 1)
    );
    assert!(near(&with(SunChoice::Towards(direction(-18.0, 31.0))), 0));
    assert!(near(&with(SunChoice::Towards(direction(140.0, -17.0))), 1));
    let none = with(SunChoice::Nothing);
    assert!(none.lights().is_empty() && none.residual().pixels() == pixels);
}

#[test]
fn wrong_values_and_options_are_refused() {
    let grid = Equirect::new(64, 32);
    let refused = |options: LightOptions, pixels: Vec<[f32; 3]>, words: &str| {
        let message = options.of_pixels(grid, pixels).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    for bad in [f32::NAN, f32::INFINITY, -1.0] {
        let mut pixels = vec![[1.0; 3]; grid.len()];
        pixels[70][2] = bad;
        refused(LightOptions::default(), pixels, "column 6, row 1");
    }
    let pixels = || vec![[1.0; 3]; grid.len()];
    refused(LightOptions::default(), vec![[1.0; 3]; 7], "2048 pixels, got 7");
    refused(LightOptions { lights: 9, ..LightOptions::default() }, pixels(), "at most 8");
    refused(LightOptions { share: 0.0, ..LightOptions::default() }, pixels(), "share");
    refused(LightOptions { contrast: f32::NAN, ..LightOptions::default() }, pixels(), "contrast");
    refused(LightOptions { sun_radius: Some(2.0), ..LightOptions::default() }, pixels(), "114");
    refused(
        LightOptions { sun: SunChoice::Towards([0.0; 3]), ..LightOptions::default() },
        pixels(),
        "direction",
    );
}

#[test]
fn tiny_maps_are_taken_as_they_are() {
    for (width, height) in [(1, 1), (2, 1), (8, 4), (33, 17), (100, 3)] {
        let grid = Equirect::new(width, height);
        let mut pixels = vec![[0.5; 3]; grid.len()];
        pixels[0] = [100.0; 3];
        let light = light_of(grid, &pixels);
        assert!(
            light.lights().len() <= 1 && light.irradiance([0.0, 0.0, 1.0])[0] > 0.0,
            "{width} × {height}"
        );
    }
}

#[test]
fn a_sun_that_a_field_draws_is_found_beside_the_lamps_of_its_code() {
    let decoder = Model::filler(&ModelConfig::decode_only(2), 1).unwrap().decoder().unwrap();
    let lamp = disc(direction(140.0, -15.0), 1.0, [0.1; 3]);
    // a sun through haze: radiance 3000 times the sky's over 4°
    let haze = Lobe { direction: direction(-20.0, 40.0), amplitude: [8.0; 3], sharpness: 1500.0 };
    let latent = Latent {
        lobes: vec![haze],
        lights: Lights::new(None, [lamp]),
        ..Latent::new(vec![[0.3, 0.1, 0.2], [0.0, 0.2, -0.1]])
    };
    let of = |latent: &Latent| Light::of_field(&decoder.condition(latent).unwrap(), 512).unwrap();
    let light = of(&latent);
    let sun = light.sun().expect("a sun");
    assert!(degrees(sun.direction, haze.direction) < 0.5, "{:?}", sun.direction);
    // the lamp is the code's, to the bit
    assert!(light.lights().others().contains(&lamp), "{:?}", light.lights());
    // no light is lost or counted twice
    let whole = decoder.condition(&latent).unwrap().bake(light.grid);
    let total = EnvironmentMap::new(light.grid, &whole).unwrap().integral()[1];
    let lights: f64 = light.lights().iter().map(|l| f64::from(l.irradiance[1])).sum();
    let sum = light.residual().integral()[1] + lights;
    assert!((sum / total - 1.0).abs() < 1e-3, "{sum} of {total}");
    // a sun of the code is the sun
    let known = disc(direction(60.0, 30.0), 0.27, [5.0; 3]);
    let light = of(&Latent { lights: Lights::new(Some(known), [lamp]), ..latent });
    assert_eq!((light.sun(), light.lights().len()), (Some(&known), 2));
}
