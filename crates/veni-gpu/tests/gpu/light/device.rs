//! The light's functions on the GPU.

use std::f64::consts::PI;

use veni_gpu::shader::{self, LightDensity};
use veni_gpu::{Error, GpuLight};
use veni_light::sphere::Equirect;

use super::{Cpu, FEW, SAMPLE, SEEN, SUN, along, differs, given, numbers, others, run, sampled, skies};
use crate::util::plain;

#[test]
fn the_gpu_is_the_twin() {
    let Some(gpu) = plain() else { return };
    for sky in skies() {
        for angle in [0.0, 0.7] {
            let differs = differs(&gpu, &sky, &sky.packed(), &shader::light(), angle);
            assert!(differs.is_none(), "{}, rotated by {angle}: {differs:?}", sky.name);
        }
    }
}

/// A rotation by the uniform is `Sampler::rotated` and `CompactLight::rotated`, with no twin between.
#[test]
fn a_rotation_by_the_uniform_is_that_of_the_cpu() {
    let Some(gpu) = plain() else { return };
    let sky = &skies()[0];
    let light = GpuLight::new(&gpu.opened.device, &sky.packed()).unwrap();
    let (pixels, us) = (sky.light.without_sun(), numbers(4096));
    for angle in [1.0, -3.0] {
        light.rotate(&gpu.opened.queue, angle).unwrap();
        let found = run(&gpu, &light, &shader::light(), SAMPLE, &given(&us));
        let found: Vec<_> = found.iter().map(sampled).collect();
        let cpu = Cpu::new(sky, &pixels, angle as f32);
        assert!(others(&found, |k| cpu.sample(us[k])) <= FEW);
        let unrotated = Cpu::new(sky, &pixels, 0.0);
        assert!(others(&found, |k| unrotated.sample(us[k])) > 4000);
    }
}

/// The density over the sphere is 1, and samples over their density are the irradiance.
#[test]
fn densities_hold_one_and_samples_are_fair() {
    let Some(gpu) = plain() else { return };
    let fine = Equirect::new(1024, 512);
    for sky in skies() {
        let light = GpuLight::new(&gpu.opened.device, &sky.packed()).unwrap();
        let seen = run(&gpu, &light, &shader::light(), SEEN, &along(&fine.directions()));
        let parts =
            seen.iter().enumerate().map(|(k, [pdf, _])| fine.solid_angle(k / fine.width) * f64::from(pdf[0]));
        let whole: f64 = parts.sum();
        // sixteen pixels for each of the map's: exact, but for the rim of a sun, and a narrow one is all rim
        let bound = match sky.light.sun() {
            None => 1e-5,
            Some(sun) if sun.radius > 0.2 => 5e-3,
            Some(_) => f64::INFINITY,
        };
        assert!((whole - 1.0).abs() < bound, "{}: the density holds {whole}", sky.name);

        let found = run(&gpu, &light, &shader::light(), SAMPLE, &given(&numbers(200_000)));
        let mut sum = 0.0;
        for sample in found.iter().map(sampled) {
            assert!((sample.direction.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5);
            // a compensated density leaves out what is even
            sum += f64::from(sample.radiance[1] * sample.direction[2].max(0.0) / sample.pdf)
                / found.len() as f64;
        }
        let exact = f64::from(sky.light.irradiance([0.0, 0.0, 1.0])[1]);
        if sky.density == LightDensity::Luminance {
            assert!((sum - exact).abs() <= 0.01 * exact, "{}: {sum} for {exact}", sky.name);
        }
    }
    // what a sun's samples alone hold
    let sky = &skies()[0];
    let light = GpuLight::new(&gpu.opened.device, &sky.packed()).unwrap();
    let [first, second] = run(&gpu, &light, &shader::light(), SUN, &[[0.3, 0.6, 0.0, 0.0]])[0];
    let energy = f64::from(second[0] / first[3]) / f64::from(sky.light.sun().unwrap().irradiance[0]);
    assert!((energy - 1.0).abs() < 1e-5 && f64::from(first[3]) < 1.0 / (PI * 1e-6));
}

#[test]
fn what_does_not_fit_is_named() {
    let Some(gpu) = plain() else { return };
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    let mut packed = skies()[0].packed();
    let light = GpuLight::new(device, &packed).unwrap();
    let refused = light.rotate(queue, f64::NAN).unwrap_err().to_string();
    assert!(refused.contains("NaN"), "{refused}");
    // one texel more than WebGPU's default limit binds
    packed.texels = vec![[0.0; 4]; (1 << 23) + 1];
    let refused = GpuLight::new(device, &packed).unwrap_err();
    assert!(matches!(&refused, Error::Unsupported(m) if m.contains("134217744")), "{refused}");
}
