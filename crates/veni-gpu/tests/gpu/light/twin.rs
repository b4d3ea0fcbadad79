//! The twin against `veni_light::light`: no device.

use veni_gpu::shader::twin::LightTwin;
use veni_gpu::shader::{LightDensity, pack_light};
use veni_light::light::Light;

use super::{Cpu, FEW, apart, numbers, others, relative, skies};
use crate::util::{directions, say};

#[test]
fn the_twin_is_the_cpus_sampler() {
    for sky in skies() {
        let pixels = sky.light.without_sun();
        for angle in [0.0, 0.7, -2.5] {
            let (twin, cpu) =
                (LightTwin::new(sky.packed()).rotated(angle), Cpu::new(&sky, &pixels, angle as f32));
            let us = numbers(4096);
            let found: Vec<_> = us.iter().map(|u| twin.veni_sample_light(*u)).collect();
            let count = others(&found, |k| cpu.sample(us[k]));
            assert!(count <= FEW, "{}, rotated by {angle}: {count} samples differ", sky.name);
            // a direction on an edge between pixels may be found on either side
            let far = directions(2000)
                .iter()
                .filter(|d| relative(twin.veni_light_pdf(**d), cpu.pdf(**d)) > 1e-5)
                .count();
            assert!(far <= FEW, "{}, rotated by {angle}: {far} densities differ", sky.name);
            // and another rotation is seen
            let other = twin.rotated(angle + 0.2);
            assert!(sky.name == "black" || others(&found, |k| other.veni_sample_light(us[k])) > 3000);
        }
    }
}

#[test]
fn the_twins_irradiance_is_that_of_lights_and_harmonics() {
    for sky in skies() {
        let rotated = sky.light.rotated(0.7);
        let (twin, sh) = (
            LightTwin::new(sky.packed()).rotated(0.7),
            sky.light.residual_sh().rotated_about_z(0.7).irradiance(),
        );
        let (mut worst, mut off, mut whole) = (0f32, 0f64, 0f64);
        let scale = sky.light.mean().into_iter().fold(1e-6, f32::max) * std::f32::consts::PI;
        for n in directions(500) {
            let lights = rotated.lights().iter().fold([0.0; 3], |sum, light| {
                let on = light.irradiance_on(n);
                [0, 1, 2].map(|c| sum[c] + on[c])
            });
            let rest = sh.value(n).map(|v| (v as f32).max(0.0));
            let found = twin.veni_irradiance(n);
            worst = worst.max(apart(found, [0, 1, 2].map(|c| lights[c] + rest[c])) / scale);
            let exact = rotated.irradiance(n);
            for c in 0..3 {
                off += f64::from(found[c] - exact[c]).powi(2);
                whole += f64::from(exact[c]).powi(2);
            }
        }
        assert!(worst < 1e-4, "{}: off by {worst} of the mean", sky.name);
        if whole > 0.0 && sky.name.starts_with("sun") {
            let rms = (off / whole).sqrt();
            say(&format!(
                "{}: nine harmonics and discs within {:.2} % RMS of the sum over pixels",
                sky.name,
                100.0 * rms
            ));
            assert!(rms < 0.02);
        }
    }
}

/// What `veni_irradiance` leaves out by keeping nine harmonics, on the panoramas of the repository.
#[test]
fn nine_harmonics_are_enough_for_panoramas() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/panoramas");
    let files = ["train", "val"].into_iter().flat_map(|part| std::fs::read_dir(folder.join(part)).unwrap());
    let mut all: Vec<f64> = files
        .map(|file| {
            let panorama = veni_image::Panorama::read(file.unwrap().path()).unwrap();
            let light = Light::of(panorama.environment().unwrap());
            let twin = LightTwin::new(pack_light(&light, LightDensity::Luminance).unwrap());
            let (mut off, mut whole) = (0.0, 0.0);
            for n in directions(500) {
                let (found, exact) = (twin.veni_irradiance(n), light.irradiance(n));
                for c in 0..3 {
                    off += f64::from(found[c] - exact[c]).powi(2);
                    whole += f64::from(exact[c]).powi(2);
                }
            }
            (off / whole).sqrt()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    let (median, worst) = (all[all.len() / 2], all[all.len() - 1]);
    say(&format!(
        "{} panoramas: irradiance within {:.2} % RMS, {:.2} % at worst",
        all.len(),
        100.0 * median,
        100.0 * worst
    ));
    assert!(all.len() == 16 && median < 0.01 && worst < 0.05);
}
