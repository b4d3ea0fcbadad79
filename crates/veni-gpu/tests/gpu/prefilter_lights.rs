//! Lights of a code in harmonics and prefiltered levels, against `veni_light::light`.

use veni_gpu::wgpu::TextureFormat;
use veni_gpu::{GpuDecoder, GpuPrefilter, PrefilteredCube};
use veni_light::latent::Latent;
use veni_light::light::{
    CompactLight, CubeAxes, CubeMap, EnvironmentMap, Law, Levels, Lights, Prefilter, Sh,
};
use veni_light::sphere::{Equirect, Frame};

use crate::prefilter::{double, relative};
use crate::util::{filler, latent, plain, say};

const FINE: Equirect = Equirect { width: 512, height: 256 };

/// A sun, half of the light, and a lamp.
fn lit(seed: u64) -> Latent {
    let sun = CompactLight::new([0.36, -0.48, 0.8], [6.0, 5.0, 4.0], CompactLight::SUN_RADIUS);
    let lamp = CompactLight::new([-0.6, 0.8, 0.0], [0.4, 0.5, 0.6], 0.02);
    Latent { lights: Lights::new(Some(sun), [lamp]), ..latent(3, seed) }
}

#[test]
fn harmonics_have_lights_in_closed_form() {
    let Some(gpu) = plain() else { return };
    let model = filler(3, 32, 2);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let skies = [lit(4), latent(3, 4), lit(5).rotated(1.0)];
    let prefilter = GpuPrefilter::with_degree(&gpu.opened.device, 24).unwrap();
    let harmonics = gpu.analyse(&prefilter, &decoder, &skies);
    let (whole, rest) = (double(&gpu.read(harmonics.coefficients())), double(&gpu.read(harmonics.rest())));
    for (k, sky) in skies.iter().enumerate() {
        let field = model.decoder().unwrap().condition(sky).unwrap();
        let pixels = field.without_lights().bake(FINE);
        let dark = Sh::<24>::of(EnvironmentMap::new(FINE, &pixels).unwrap());
        let lit = field.lights().iter().fold(dark.clone(), |sum, light| sum.plus(&Sh::of_light(light)));
        for (found, expected) in [(&whole, &lit), (&rest, &dark)] {
            let own = &found[k * 625..][..625];
            let nine = relative(&own[..9], &expected.coefficients()[..9]);
            let all = relative(own, expected.coefficients());
            // what the field has beyond degree 24 comes back as a little of what is below it
            assert!(nine < 1e-3 && all < 8e-3, "latent {k}: {nine:e} {all:e}");
        }
        if k != 1 {
            assert!(relative(&rest[k * 625..][..9], &lit.coefficients()[..9]) > 0.1);
        }
    }
}

/// Every level against the CPU's, which has lights in closed form too, a narrow one among them; and energy.
#[test]
fn levels_have_lights_of_every_width() {
    let Some(gpu) = plain() else { return };
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    let model = filler(3, 32, 2);
    let decoder = GpuDecoder::new(device, &model).unwrap();
    let prefilter = GpuPrefilter::new(device).unwrap();
    let (turn, size, count) = (0.7, 64, 5);
    let skies = [latent(3, 4), lit(4)];
    let latents = decoder.condition_batch(queue, &skies).unwrap();
    let harmonics = gpu.analyse(&prefilter, &decoder, &skies);
    let levels = Levels::new(size, count, Law::Quadratic);
    let field = model.decoder().unwrap().condition(&lit(4).rotated(turn)).unwrap();
    let pixels = field.without_lights().bake(FINE);
    let rest = Prefilter::new(EnvironmentMap::new(FINE, &pixels).unwrap(), &[levels]);
    let cpu = rest.clone().with_lights(field.lights());
    for frame in [Frame::Blender, Frame::Bevy] {
        let [chain, dark] = [true, false].map(|lights| {
            let chain = gpu.chain(TextureFormat::Rgba32Float, size as u32, count as u32, 2);
            let cube = PrefilteredCube::new(&chain, Law::Quadratic).frame(frame).rotate(turn);
            let cube = if lights { cube } else { cube.without_lights() };
            let mut encoder = device.create_command_encoder(&Default::default());
            prefilter.bake(&mut encoder, &decoder, &latents, &harmonics, &cube).unwrap();
            queue.submit([encoder.finish()]);
            chain
        });
        for level in 0..count {
            let (p, texels) = (levels.roughness(level), 6 * levels.size(level).pow(2));
            // the second latent's
            let second = |chain| gpu.level(chain, level as u32)[texels..].to_vec();
            let (found, without) = (second(&chain), second(&dark));
            let expected = cpu.level(p, levels.size(level), CubeAxes::of(frame));
            let off = relative(&found, &double(expected.texels()));
            let [a, b] =
                [&found, expected.texels()].map(|t| CubeMap::new(levels.size(level), t.to_vec()).integral());
            let energy = (0..3).map(|c| (a[c] / b[c] - 1.0).abs()).fold(0.0, f64::max);
            if frame == Frame::Blender {
                say(&format!(
                    "sun at p = {p:.3}: relative RMSE {:.3} %, energy off by {energy:.1e}",
                    100.0 * off
                ));
            }
            // the first level of the CPU hands energy out by places on the disc
            assert!(off < if level == 0 { 0.05 } else { 5e-3 }, "{frame:?}, level {level}: {off:e}");
            assert!(energy < 1e-3, "{frame:?}, level {level}: {energy:e}");
            let expected = rest.level(p, levels.size(level), CubeAxes::of(frame));
            let off = relative(&without, &double(expected.texels()));
            // the first level of the CPU is looked up in the panorama's pixels
            let most = if level == 0 { 0.05 } else { 5e-3 };
            assert!(off < most, "{frame:?}, level {level} without lights: {off:e}");
            assert!(relative(&without, &double(&found)) > 0.02);
        }
        // the first latent has none, in either chain
        assert_eq!(gpu.level(&chain, 2)[..6 * 256], gpu.level(&dark, 2)[..6 * 256]);
    }
}
