//! Lights and lobes of a code: the function against its twin and the CPU's field, and their energy in whatever is baked.

use veni_gpu::decoder::KernelChoice;
use veni_gpu::shader::twin::{direction_of, listed};
use veni_gpu::shader::{Grid, Kernel, Request, pack_gains};
use veni_gpu::wgpu::TextureFormat;
use veni_gpu::{Bake, GpuDecoder};
use veni_light::latent::{Latent, Lobe};
use veni_light::light::{CompactLight, Lights};
use veni_light::model::Model;
use veni_light::sphere::{CubeFace, Equirect, Frame};

use crate::kernels::{TILED, Work, list_variant};
use crate::stages::{each, each_changed};
use crate::util::{Gpu, agrees, difference, directions, filler, latent, plain, say};

const SUN: [f32; 3] = [0.36, -0.48, 0.8];

fn sun() -> CompactLight {
    CompactLight::new(SUN, [3.0, 2.5, 2.0], CompactLight::SUN_RADIUS)
}

/// A glow of 3° across the seam, and one of 20°.
fn glows() -> [CompactLight; 2] {
    let light = |d, radius: f32| CompactLight::new(d, [0.5, 0.7, 0.9], radius.to_radians());
    [light([-0.8, 0.0, -0.6], 3.0), light([0.0, 1.0, 0.0], 20.0)]
}

fn lobes() -> Vec<Lobe> {
    let lobe = |direction, a: f32, sharpness| Lobe { direction, amplitude: [a, -a, 0.5 * a], sharpness };
    vec![lobe([0.6, 0.8, 0.0], 1.5, 3.0), lobe(SUN, -0.8, 300.0), lobe([0.0, 0.0, -1.0], 0.6, 20.0)]
}

/// A code with everything.
fn lit(n: usize, seed: u64) -> Latent {
    Latent { lights: Lights::new(Some(sun()), glows()), lobes: lobes(), log_exposure: 0.3, ..latent(n, seed) }
}

/// Directions spread over the sphere, and some across every light and lobe.
fn looks(latent: &Latent, turn: f64) -> Vec<[f32; 3]> {
    let mut all = directions(200);
    let lights = latent.lights.rotated(turn);
    for light in lights.iter() {
        let [x, y, z] = light.direction;
        for k in -6..=6 {
            // not on the edge, where two rounded numbers are compared
            let (s, c) = (0.31 * k as f32 * light.radius).sin_cos();
            let r = x.hypot(y);
            all.push([c * x - s * z * x / r, c * y - s * z * y / r, c * z + s * r]);
        }
    }
    all
}

/// Logarithms, so that bright and dark count alike.
fn log(all: &[[f32; 3]]) -> Vec<[f32; 3]> {
    all.iter().map(|rgb| rgb.map(|v| v.max(1e-30).ln())).collect()
}

fn work(latent: &Latent) -> Work {
    let mut work = Work::new(&filler(4, 24, 2), std::slice::from_ref(latent), looks(latent, 0.0));
    (work.request.frame, work.request.rotation, work.request.logarithm) = (Frame::Blender, 0.0, false);
    work
}

#[test]
fn the_function_is_its_twin_and_the_field() {
    let latent = lit(4, 3);
    let work = work(&latent);
    let field = filler(4, 24, 2).decoder().unwrap().condition(&latent).unwrap();
    let of = |expression: &str| -> Option<Vec<[f32; 3]>> {
        Some(each(&work, false, expression)?.into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
    };
    let Some(lights) = of("vec4f(veni_lights(direction), 0.0)") else { return };
    let lobes = of("vec4f(veni_lobes(veni_latent(0u), direction), 0.0)").unwrap();
    let radiance = of("vec4f(veni_radiance(direction), 0.0)").unwrap();
    let logarithm = of("vec4f(veni_log_radiance(direction), 0.0)").unwrap();
    let mut met = 0;
    for (k, d) in work.directions.iter().enumerate() {
        let expected = work.twin.veni_lights_of(0, listed(&work.request, *d));
        for (a, b) in lights[k].iter().zip(expected) {
            assert!((f64::from(*a) - b).abs() <= 1e-5 * b + 1e-6, "{d:?}: {a} for {b}");
        }
        met += usize::from(expected[0] > 1e3);
        for (a, b) in lobes[k].iter().zip(work.twin.veni_lobes(0, *d)) {
            assert!((f64::from(*a) - b).abs() <= 1e-5, "{d:?}: {a} for {b}");
        }
    }
    assert!(met >= 7, "{met} directions meet the sun");
    let mut expected = vec![[0.0; 3]; radiance.len()];
    field.radiance_batch(&work.directions, &mut expected);
    let off = difference(&log(&radiance), &log(&expected));
    assert!(agrees(off), "radiance: {off:?}");
    field.log_radiance_batch(&work.directions, &mut expected);
    let off = difference(&logarithm, &expected);
    assert!(agrees(off), "log radiance: {off:?}");
}

#[test]
fn directions_in_every_frame_turned_and_brightened() {
    let Some(gpu) = plain() else { return };
    let (model, latent, turn) = (filler(4, 24, 2), lit(4, 5), 0.7);
    let field = model.decoder().unwrap().condition(&latent).unwrap().rotated(turn).brightened(0.5);
    let native = looks(&latent, turn);
    let mut expected = vec![[0.0; 3]; native.len()];
    field.radiance_batch(&native, &mut expected);
    for choice in [KernelChoice::PlainTiled, KernelChoice::PlainEach] {
        let decoder = GpuDecoder::with_kernel(&gpu.opened.device, &model, choice).unwrap();
        let latents = decoder.condition(&gpu.opened.queue, &latent).unwrap();
        for frame in Frame::ALL {
            let list: Vec<_> = native.iter().map(|d| frame.from_native(*d)).collect();
            let (from, to) = (gpu.upload(&list), gpu.pixels(list.len()));
            let bake =
                Bake::directions(&from, &to, list.len() as u32).frame(frame).rotate(turn).brighten(0.5);
            gpu.bake(&decoder, &latents, &bake);
            let off = difference(&log(&gpu.read(&to)), &log(&expected));
            assert!(agrees(off), "{choice:?}, {frame:?}: {off:?}");
        }
    }
}

fn decoder(gpu: &Gpu) -> (Model, GpuDecoder) {
    let model = filler(1, 8, 1);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    (model, decoder)
}

/// Pixels are the CPU's, in textures and in bands of rows, where pixels are larger than the lights and where they are smaller.
#[test]
fn panoramas_are_the_fields() {
    let Some(gpu) = plain() else { return };
    let (model, decoder) = decoder(&gpu);
    let latent = lit(1, 5);
    let latents = decoder.condition(&gpu.opened.queue, &latent).unwrap();
    let field = model.decoder().unwrap().condition(&latent).unwrap();
    for (width, height) in [(16, 8), (64, 32), (500, 250), (1024, 512)] {
        let grid = Equirect::new(width as usize, height as usize);
        let turn = 2.0;
        let expected = log(&field.rotated(turn).bake(grid));
        let texture = gpu.texture(TextureFormat::Rgba32Float, [width, height, 1]);
        gpu.bake(&decoder, &latents, &Bake::equirect(&texture).rotate(turn));
        let off = difference(&log(&gpu.read_texture(&texture)), &expected);
        say(&format!("lit panorama of {width} × {height}: off by {:.1e}, {:.1e}", off.0, off.1));
        assert!(agrees(off), "{width} × {height}: {off:?}");
        let rows = height / 4..height / 2 + 1;
        let pixels = gpu.pixels(rows.len() * grid.width);
        let whole = Grid::Equirect { width, height };
        gpu.bake(&decoder, &latents, &Bake::rows(&pixels, whole, rows.clone()).rotate(turn));
        let own = &expected[rows.start as usize * grid.width..][..rows.len() * grid.width];
        let off = difference(&log(&gpu.read(&pixels)), own);
        assert!(agrees(off), "rows of {width} × {height}: {off:?}");
    }
}

/// What the lights alone add, summed over pixels of these solid angles.
fn energy(lit: &[[f32; 3]], dark: &[[f32; 3]], solid_angle: impl Fn(usize) -> f64) -> [f64; 3] {
    let of = |k: usize, c: usize| solid_angle(k) * (f64::from(lit[k][c]) - f64::from(dark[k][c]));
    [0, 1, 2].map(|c| (0..lit.len()).map(|k| of(k, c)).sum())
}

#[test]
fn energy_is_right_at_any_size_and_in_cube_faces() {
    let Some(gpu) = plain() else { return };
    let (_, decoder) = decoder(&gpu);
    let [glow, _] = glows();
    for light in [sun(), CompactLight { direction: [0.0, 0.0, 1.0], ..sun() }, glow] {
        let code = Latent { lights: Lights::new(Some(light), []), ..latent(1, 5) };
        let latents = decoder.condition(&gpu.opened.queue, &code).unwrap();
        let check = |what: &str, found: [f64; 3]| {
            for (found, expected) in found.into_iter().zip(light.irradiance) {
                let off = found / f64::from(expected) - 1.0;
                assert!(off.abs() < 1e-3, "{what}, {light:?}: off by {off:e}");
            }
        };
        for (width, height) in [(64, 32), (1024, 512)] {
            let grid = Equirect::new(width as usize, height as usize);
            let texture = gpu.texture(TextureFormat::Rgba32Float, [width, height, 1]);
            let baked = [Bake::equirect(&texture), Bake::equirect(&texture).without_lights()].map(|bake| {
                gpu.bake(&decoder, &latents, &bake.rotate(0.3));
                gpu.read_texture(&texture)
            });
            check("panorama", energy(&baked[0], &baked[1], |k| grid.solid_angle(k / grid.width)));
        }
        for frame in Frame::ALL {
            let size = 24;
            let texture = gpu.texture(TextureFormat::Rgba32Float, [size, size, 6]);
            let baked = [Bake::cube(&texture), Bake::cube(&texture).without_lights()].map(|bake| {
                gpu.bake(&decoder, &latents, &bake.frame(frame).rotate(0.3));
                gpu.read_texture(&texture)
            });
            let size = size as usize;
            let solid_angle = |k: usize| CubeFace::solid_angle(size, k % size, k / size % size);
            check("cube", energy(&baked[0], &baked[1], solid_angle));
            // and where the light is
            let at = brightest(&baked[0]);
            let d = CubeFace::ALL[at / (size * size)].direction(frame, size, at % size, at / size % size);
            let towards = light.rotated(0.3).direction;
            let cosine: f32 = d.iter().zip(towards).map(|(a, b)| a * b).sum();
            assert!(cosine > 0.99, "{frame:?}: {d:?} for {towards:?}");
        }
    }
}

/// Index of the brightest pixel.
fn brightest(pixels: &[[f32; 3]]) -> usize {
    (0..pixels.len()).max_by(|a, b| pixels[*a][0].total_cmp(&pixels[*b][0])).unwrap()
}

#[test]
fn every_latent_of_a_batch_has_its_own_lights() {
    let Some(gpu) = plain() else { return };
    let (model, decoder) = decoder(&gpu);
    let codes = [latent(1, 1), lit(1, 2).rotated(1.0), Latent { lobes: Vec::new(), ..lit(1, 3) }];
    let latents = decoder.condition_batch(&gpu.opened.queue, &codes).unwrap();
    let grid = Equirect::new(48, 24);
    let texture = gpu.texture(TextureFormat::Rgba32Float, [48, 24, 3]);
    let check = |codes: &[Latent]| {
        gpu.bake(&decoder, &latents, &Bake::equirect(&texture));
        for (layer, code) in gpu.read_texture(&texture).chunks_exact(grid.len()).zip(codes) {
            let expected = model.decoder().unwrap().condition(code).unwrap().bake(grid);
            let off = difference(&log(layer), &log(&expected));
            assert!(agrees(off), "{off:?}");
        }
    };
    check(&codes);
    decoder.update(&gpu.opened.queue, &latents, 0, &[codes[1].clone(), codes[0].clone()]).unwrap();
    check(&[codes[1].clone(), codes[0].clone(), codes[2].clone()]);
}

/// Black lights and lobes leave every bit as it is, and so does a request without lights.
#[test]
fn codes_without_lights_have_the_same_bits() {
    let Some(gpu) = plain() else { return };
    let model = filler(9, 128, 6);
    let none = latent(9, 1);
    let lights = lit(9, 1).lights.scaled(0.0);
    let lobes = lobes().into_iter().map(|lobe| Lobe { amplitude: [0.0; 3], ..lobe }).collect();
    let black = Latent { lights, lobes, ..none.clone() };
    let (from, grid) = (gpu.upload(&directions(100)), Grid::Equirect { width: 16, height: 8 });
    for choice in [KernelChoice::PlainTiled, KernelChoice::PlainEach] {
        let decoder = GpuDecoder::with_kernel(&gpu.opened.device, &model, choice).unwrap();
        let bits = |latent: &Latent, change: &dyn for<'a> Fn(Bake<'a>) -> Bake<'a>| {
            let latents = decoder.condition(&gpu.opened.queue, latent).unwrap();
            let (pixels, to) = (gpu.pixels(128), gpu.pixels(100));
            gpu.bake(&decoder, &latents, &change(Bake::rows(&pixels, grid, 0..8)));
            gpu.bake(&decoder, &latents, &change(Bake::directions(&from, &to, 100)));
            [gpu.read(&pixels), gpu.read(&to)].concat()
        };
        let plain = bits(&none, &|bake| bake);
        assert!(plain == bits(&black, &|bake| bake), "{choice:?}");
        let lit = Latent { lights: lit(9, 1).lights, ..none.clone() };
        assert!(plain == bits(&lit, &|bake| bake.without_lights()), "{choice:?}");
        assert!(plain != bits(&lit, &|bake| bake), "{choice:?}");
        let (a, b) = (bits(&none, &|bake| bake.logarithm()), bits(&lit, &|bake| bake.logarithm()));
        assert!(a == b, "{choice:?}");
    }
}

/// Deliberate mistakes in the function, which the comparison with the twin must catch.
#[test]
fn mistakes_in_the_function_are_noticed() {
    let Some(gpu) = plain() else { return };
    let work = work(&lit(4, 3));
    let expected = log(&work.expected());
    for kernel in [TILED, Kernel::Each] {
        let variant = list_variant(work.twin.sizes, kernel);
        let agrees =
            |source: &str| agrees(difference(&log(&work.log_radiance(&gpu, &variant, source)), &expected));
        let source = variant.source();
        assert!(agrees(&source), "unbroken");
        for (from, to) in [
            ("square <= light.w", "square < 0.0"),
            ("light.w * square", "2.0 * light.w * square"),
            ("let away = direction - light.xyz", "let away = direction + light.xyz"),
            ("lobe.w * dot(away, away)", "lobe.w"),
            ("m < count", "m + 1u < count"),
            ("k < count", "k + 1u < count"),
            ("request.light_scale * lights", "lights"),
        ] {
            assert!(source.contains(from), "the shader no longer has `{from}`: the break breaks nothing");
            assert!(
                !agrees(&source.replace(from, to)),
                "{kernel:?}: `{to}` in place of `{from}` is not noticed"
            );
        }
    }
}

/// The same of lights on pixels: each kind of light that a grid tells apart.
#[test]
fn mistakes_on_pixels_are_noticed() {
    let (grid, turn) = (Grid::Equirect { width: 64, height: 32 }, 0.4);
    let count = grid.directions() as u32;
    let request = Request { grid, count, rotation: turn, ..work(&latent(4, 3)).request };
    // one that a pixel's middle meets: it must not be drawn there as well
    let lamp = CompactLight::new(direction_of(&request, 700), [0.1; 3], 0.02);
    let mut code = lit(4, 3);
    code.lights = Lights::new(Some(sun()), glows().into_iter().chain([lamp]));
    let mut work = Work { request, ..work(&code) };
    let field = filler(4, 24, 2).decoder().unwrap().condition(&code).unwrap();
    work.gains = pack_gains(&request, &[field.lights().clone()]);
    let expected: Vec<_> = (0..count)
        .map(|index| {
            let d = direction_of(&work.request, index);
            work.twin.lights_at(&work.request, &work.gains, 0, index, d).map(|v| v as f32)
        })
        .collect();
    let off = |from: &str, to: &str| {
        let change = |source: String| {
            assert!(source.contains(from), "the shader no longer has `{from}`: the break breaks nothing");
            source.replace(from, to)
        };
        let found = each_changed(&work, true, "vec4f(lights, 0.0)", &change)?;
        let found: Vec<_> = found.into_iter().map(|[r, g, b, _]| [r, g, b]).collect();
        let scale = |all: &[[f32; 3]]| all.iter().map(|v| v.map(|v| (1.0 + v).ln())).collect::<Vec<_>>();
        Some(difference(&scale(&found), &scale(&expected)))
    };
    let Some(unbroken) = off("m++", "m++") else { return };
    assert!(agrees(unbroken), "{unbroken:?}");
    for (from, to) in [
        ("extent >= -request.smoothest", "extent < -request.smoothest"),
        ("extent < 0.0 && extent", "extent"),
        ("low = middle + 1u", "low = middle + 2u"),
        ("gains[low].x == index", "gains[low].x >= index"),
        ("gains[low].yzw", "gains[low].zyw"),
        ("gains[latent].x + gains[latent].y", "gains[latent].x"),
    ] {
        let off = off(from, to).unwrap();
        assert!(!agrees(off), "`{to}` in place of `{from}` is not noticed: {off:?}");
    }
}

/// The packed numbers are what is used: a light moved by half of its radius in the buffer is seen.
#[test]
fn a_light_in_the_wrong_place_is_noticed() {
    let Some(gpu) = plain() else { return };
    let mut work = work(&lit(4, 3));
    let (expected, variant) = (log(&work.expected()), list_variant(work.twin.sizes, TILED));
    let sizes = work.twin.sizes;
    let at = 4 * (sizes.columns() * (sizes.layers + 1) + sizes.latents + 1);
    assert_eq!(work.twin.latents[at..at + 3], SUN);
    work.twin.latents[at] += 0.003;
    let off = difference(&log(&work.log_radiance(&gpu, &variant, &variant.source())), &expected);
    assert!(!agrees(off), "{off:?}");
}
