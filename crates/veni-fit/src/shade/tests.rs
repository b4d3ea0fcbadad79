//! Closed forms, gradients against differences, and the two ways of keeping the matrix.

use std::f64::consts::PI;

use super::*;
use veni_light::sphere::Equirect;

const BALL: ([f64; 3], f64) = ([0.0; 3], 1.0);

fn ball(size: usize) -> Surface {
    let camera = Camera::framing(BALL, [0.4, 0.2], REFERENCE_FIELD_OF_VIEW, [size, size], 0.05).unwrap();
    Surface::sphere(&camera, BALL, size, size).unwrap()
}

/// Light of many directions and colours.
fn sky(lights: &DistantLights) -> Vec<[f32; 3]> {
    let log = |d: &[f32; 3]| [d[0] + 0.5 * d[2], 0.3 - d[1], (3.0 * d[0]).sin() * d[2]];
    lights.directions().iter().map(|d| log(d).map(f32::exp)).collect()
}

fn materials(pixels: usize) -> [(&'static str, Material); 4] {
    let red = Colour::Uniform([0.8, 0.4, 0.2]);
    let map = (0..pixels).map(|k| [0.2 + 0.6 * (k % 7) as f32 / 7.0, 0.5, 0.9]).collect();
    [
        ("Lambert", Material::lambert(red.clone())),
        ("one grey row", Material::blinn_phong(Colour::Uniform([0.9; 3]), 0.3, 20.0)),
        ("two rows", Material::blinn_phong(red, 0.3, 20.0)),
        ("a map", Material::blinn_phong(Colour::Map(map), 0.5, 60.0)),
    ]
}

#[test]
fn in_a_white_furnace_a_surface_has_the_colour_of_its_albedo() {
    let (surface, grid) = (ball(12), Equirect::new(128, 64));
    let material = Material::lambert(Colour::Uniform([0.8, 0.5, 0.1]));
    let transfer =
        Transfer::new(&surface, &material, DistantLights::equirect(grid), ShadingForm::Physical).unwrap();
    for (value, valid) in transfer.render(&vec![[3.0; 3]; grid.len()]).iter().zip(surface.valid()) {
        let expected = if *valid { [2.4, 1.5, 0.3] } else { [0.0; 3] };
        for (v, e) in value.iter().zip(expected) {
            assert!((v - e).abs() <= 1e-3 * e, "{value:?}");
        }
    }
    // a shiny surface loses some light at grazing angles, and gains none
    let shiny = Material::blinn_phong(Colour::Uniform([1.0; 3]), 0.6, 50.0);
    let transfer =
        Transfer::new(&surface, &shiny, DistantLights::equirect(grid), ShadingForm::Physical).unwrap();
    let image = transfer.render(&vec![[1.0; 3]; grid.len()]);
    for k in (0..image.len()).filter(|k| surface.valid()[*k]) {
        let facing = -(0..3).map(|c| surface.normals()[k][c] * surface.rays()[k][c]).sum::<f32>();
        assert!(image[k][0] < 1.003, "{:?}", image[k]);
        assert!(facing < 0.97 || image[k][0] > 0.96, "{:?} facing {facing}", image[k]);
    }
}

#[test]
fn lambert_under_a_hemisphere_and_under_a_cosine_lobe() {
    let (surface, grid) = (ball(16), Equirect::new(256, 128));
    let white = Material::lambert(Colour::Uniform([1.0; 3]));
    let transfer =
        Transfer::new(&surface, &white, DistantLights::equirect(grid), ShadingForm::Physical).unwrap();
    let render = |light: &dyn Fn(f32) -> f32| {
        let radiance: Vec<_> = grid.directions().iter().map(|d| [light(d[2]); 3]).collect();
        transfer.render(&radiance)
    };
    let hemisphere = render(&|z| if z > 0.0 { 1.0 } else { 0.0 });
    let lobe = render(&|z| z.max(0.0));
    for k in (0..surface.valid().len()).filter(|k| surface.valid()[*k]) {
        let cos = f64::from(surface.normals()[k][2]);
        // half the sky is seen, weighted by the cosine
        let expected = 0.5 * (1.0 + cos);
        assert!((f64::from(hemisphere[k][0]) - expected).abs() < 2e-3, "{cos}: {:?}", hemisphere[k]);
        // ∫ max(n·l,0) max(z·l,0) dω/π = (2/3π)(sin γ + (π − γ) cos γ), γ between n and z
        let angle = cos.clamp(-1.0, 1.0).acos();
        let expected = 2.0 / (3.0 * PI) * (angle.sin() + (PI - angle) * cos);
        assert!((f64::from(lobe[k][0]) - expected).abs() < 2e-3, "{cos}: {:?} not {expected}", lobe[k]);
    }
}

#[test]
fn a_mirror_like_lobe_shows_the_sky_in_the_mirror_direction() {
    let (surface, grid) = (ball(10), Equirect::new(256, 128));
    let mirror = Material::blinn_phong(Colour::Uniform([0.0; 3]), 1.0, 20_000.0);
    let transfer =
        Transfer::new(&surface, &mirror, DistantLights::equirect(grid), ShadingForm::Physical).unwrap();
    let light: Vec<_> = grid.directions().iter().map(|d| [1.5 + d[0], 1.5 + d[1], 1.5 + d[2]]).collect();
    let image = transfer.render(&light);
    for k in (0..image.len()).filter(|k| surface.valid()[*k]) {
        let (n, ray) = (surface.normals()[k], surface.rays()[k]);
        let along = (0..3).map(|c| n[c] * ray[c]).sum::<f32>();
        // near the outline the lobe loses energy
        if along < -0.9 {
            let mirrored = [0, 1, 2].map(|c| 1.5 + ray[c] - 2.0 * along * n[c]);
            for c in 0..3 {
                assert!((image[k][c] / mirrored[c] - 1.0).abs() < 0.25, "{:?} not {mirrored:?}", image[k]);
            }
        }
    }
}

#[test]
fn rows_computed_on_the_fly_are_those_that_would_be_stored() {
    let surface = ball(9);
    for form in [ShadingForm::Physical, ShadingForm::Reference] {
        for (name, material) in materials(81) {
            let lights = DistantLights::icosahedron(150, false);
            let light = sky(&lights);
            let [stored, fly] = [DEFAULT_MEMORY, 0]
                .map(|m| Transfer::with_memory(&surface, &material, lights.clone(), form, m).unwrap());
            assert!(stored.is_stored() && !fly.is_stored());
            assert_eq!(stored.render(&light), fly.render(&light), "{name}");
            let gradient: Vec<_> = (0..81).map(|k| [k as f32, 1.0, -0.5]).collect();
            assert_eq!(stored.pull_back(&light, &gradient), fly.pull_back(&light, &gradient), "{name}");
        }
    }
}

#[test]
fn pulling_back_is_the_transpose_of_rendering() {
    let surface = ball(11);
    for (name, material) in materials(121) {
        let lights = DistantLights::icosahedron(150, false);
        let transfer = Transfer::new(&surface, &material, lights.clone(), ShadingForm::Physical).unwrap();
        let (light, wave) = (sky(&lights), |k: usize| (k as f32 * 0.7).sin());
        let gradient: Vec<_> = (0..121).map(|k| [wave(k), wave(3 * k), wave(5 * k)]).collect();
        let product = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f64 {
            a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| f64::from(x * y)).sum()
        };
        let (forward, back) = (
            product(&transfer.render(&light), &gradient),
            product(&light, &transfer.pull_back(&light, &gradient)),
        );
        assert!((forward - back).abs() < 1e-4 * forward.abs().max(1.0), "{name}: {forward} and {back}");
    }
}

#[test]
fn pixels_of_one_normal_share_a_row() {
    let normals = vec![[0.0, 0.0, 1.0]; 64];
    let rays = Camera::reference().rays(8, 8);
    let surface = Surface::new([8, 8], &normals, &rays, None).unwrap();
    let map = Colour::Map((0..64).map(|k| [k as f32 / 64.0; 3]).collect());
    let lights = DistantLights::icosahedron(42, false);
    let bytes = 48 * 4;
    let flat = Transfer::with_memory(
        &surface,
        &Material::lambert(map),
        lights.clone(),
        ShadingForm::Physical,
        bytes,
    );
    let flat = flat.unwrap();
    assert!(flat.is_stored(), "one row of 42 lights, padded to 48");
    let image = flat.render(&vec![[1.0; 3]; 42]);
    assert!((image[63][0] / image[1][0] - 63.0).abs() < 1e-3);
}

/// Central differences along a few coordinates, and along the exposure.
fn check_gradient(image: &RenderedImage, log_radiance: &[[f32; 3]], s: f32, name: &str) {
    let (_, gradient, exposure) = image.evaluate(log_radiance, s);
    let derivative = |d: &[[f32; 3]], ds: f32| {
        let h = 2e-3;
        let at = |sign: f32| {
            let moved: Vec<_> =
                log_radiance.iter().zip(d).map(|(x, d)| [0, 1, 2].map(|c| x[c] + sign * h * d[c])).collect();
            image.evaluate(&moved, s + sign * h * ds).0
        };
        (at(1.0) - at(-1.0)) / f64::from(2.0 * h)
    };
    let zero = vec![[0.0; 3]; log_radiance.len()];
    let expected = derivative(&zero, 1.0);
    assert!((exposure - expected).abs() < 2e-3 * expected.abs().max(0.05), "{name}: {exposure}, {expected}");
    for k in 1..4 {
        let direction: Vec<_> =
            (0..zero.len()).map(|l| [0, 1, 2].map(|c| ((k * (3 * l + c)) as f32 * 0.37).sin())).collect();
        let pairs = direction.iter().flatten().zip(gradient.iter().flatten());
        let (ours, expected) =
            (pairs.map(|(a, b)| f64::from(a * b)).sum::<f64>(), derivative(&direction, 0.0));
        assert!((ours - expected).abs() < 5e-3 * expected.abs().max(0.05), "{name}: {ours}, {expected}");
    }
}

#[test]
fn gradients_are_those_of_the_loss() {
    let surface = ball(12);
    let losses = [RenderingLoss::default(), RenderingLoss::ReferenceLog, RenderingLoss::demo()];
    for (loss, exposure) in
        losses.into_iter().zip([ExposureForm::Natural, ExposureForm::Reference, ExposureForm::Natural])
    {
        for (name, material) in materials(144) {
            let lights = DistantLights::icosahedron(90, false);
            let transfer = Transfer::new(&surface, &material, lights.clone(), ShadingForm::Physical).unwrap();
            // a target of other light, so that no difference is near the kink at 0
            let target = transfer.render(&vec![[9.0, 0.3, 4.0]; lights.len()]);
            let image = RenderedImage::new(transfer, &target, loss).unwrap().with_exposure(exposure);
            let log: Vec<_> = sky(&lights).into_iter().map(|p| p.map(f32::ln)).collect();
            check_gradient(&image, &log, -0.4, &format!("{loss:?}, {name}"));
        }
    }
}

#[test]
fn the_light_that_made_an_image_has_no_loss() {
    let surface = ball(12);
    for loss in [RenderingLoss::default(), RenderingLoss::ReferenceLog, RenderingLoss::demo()] {
        let lights = DistantLights::equirect(Equirect::new(16, 8));
        let material = Material::blinn_phong(Colour::Uniform([0.9; 3]), 0.3, 20.0);
        let transfer = Transfer::new(&surface, &material, lights.clone(), ShadingForm::Physical).unwrap();
        let light = sky(&lights);
        let mut target = transfer.render(&light);
        // an unknown pixel, and another that shows nothing: neither counts
        let visible = surface.valid().iter().position(|v| *v).unwrap();
        let hidden = surface.valid().iter().position(|v| !*v).unwrap();
        (target[visible], target[hidden]) = ([f32::NAN; 3], [500.0; 3]);
        let image = RenderedImage::new(transfer, &target, loss).unwrap();
        let log: Vec<_> = light.iter().map(|p| p.map(f32::ln)).collect();
        let (same, gradient, _) = image.evaluate(&log, 0.0);
        let (brighter, ..) = image.evaluate(&log, 0.5);
        assert!(same < 1e-4 && same < 1e-3 * brighter, "{loss:?}: {same}, {brighter}");
        assert!(gradient.iter().flatten().all(|v| v.is_finite()));
        assert_eq!(image.evaluate(&log, 0.25), image.evaluate(&log, 0.25), "the same bits");
    }
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let surface = ball(8);
    let white = Material::lambert(Colour::Uniform([1.0; 3]));
    let transfer =
        Transfer::new(&surface, &white, DistantLights::icosahedron(12, false), ShadingForm::Physical)
            .unwrap();
    let message = |target: &[[f32; 3]], loss| {
        RenderedImage::new(transfer.clone(), target, loss).unwrap_err().to_string()
    };
    assert!(message(&[[1.0; 3]; 9], RenderingLoss::default()).contains("9 pixels, the surface 8 × 8"));
    assert!(message(&[[f32::NAN; 3]; 64], RenderingLoss::default()).contains("finite"));
    for loss in [RenderingLoss::default(), RenderingLoss::ReferenceLog] {
        assert!(message(&[[0.0; 3]; 64], loss).contains("target"));
    }
    let odd = RenderingLoss::RobustLog { delta: 0.0, floor: 1.0 };
    assert!(message(&[[1.0; 3]; 64], odd).contains("delta 0"));
    let rays = Camera::reference().rays(2, 2);
    let message = |n: &[[f32; 3]], rays: &[[f32; 3]], mask| {
        Surface::new([2, 2], n, rays, mask).unwrap_err().to_string()
    };
    let up = [[0.0, 0.0, 1.0]; 4];
    assert!(message(&up[..3], &rays, None).contains("3 normals for 2 × 2"));
    assert!(message(&up, &rays[..3], None).contains("3 rays"));
    assert!(message(&up, &rays, Some(&[true; 5])).contains("5 mask values"));
    assert!(message(&up, &rays, Some(&[false; 4])).contains("none of the 2 × 2"));
    assert!(message(&up, &[[0.0; 3]; 4], None).contains("ray"));
}
