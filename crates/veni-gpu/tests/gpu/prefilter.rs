//! Harmonics and prefiltered levels on the GPU against their twin and against `veni_light::light`.

use veni_gpu::shader::twin::{veni_degrees, veni_harmonics};
use veni_gpu::shader::{SpectrumTables, StorageFormat, level_source, spectrum_source};
use veni_gpu::wgpu::{self, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages};
use veni_gpu::{Bake, GpuDecoder, GpuHarmonics, GpuPrefilter, PrefilteredCube, read_back};
use veni_light::latent::Latent;
use veni_light::light::{CubeAxes, EnvironmentMap, Law, Levels, Prefilter, Sh, lobe_gains};
use veni_light::model::Model;
use veni_light::sphere::{CubeFace, Equirect, Frame};

use crate::util::{Gpu, filler, latent, plain, say};

fn pretrained() -> Model {
    Model::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../veni-light/assets/veni-27.safetensors")).unwrap()
}

fn sky(model: &Model, seed: u64) -> Latent {
    // of the vectors: what lights add is compared in `prefilter_lights`
    Latent::new(Latent::from_seed(&model.prior(), seed).vectors)
}

impl Gpu {
    pub(crate) fn chain(&self, format: TextureFormat, size: u32, levels: u32, latents: u32) -> Texture {
        self.opened.device.create_texture(&TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 6 * latents },
            mip_level_count: levels,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    /// A level of a chain.
    pub(crate) fn level(&self, chain: &Texture, level: u32) -> Vec<[f32; 3]> {
        let size = chain.width() >> level;
        let one = self.texture_with(
            chain.format(),
            [size, size, chain.depth_or_array_layers()],
            TextureUsages::COPY_DST,
        );
        let mut encoder = self.opened.device.create_command_encoder(&Default::default());
        let at = |texture, mip_level| wgpu::TexelCopyTextureInfo {
            texture,
            mip_level,
            origin: wgpu::Origin3d::ZERO,
            aspect: wgpu::TextureAspect::All,
        };
        encoder.copy_texture_to_texture(at(chain, level), at(&one, 0), one.size());
        self.opened.queue.submit([encoder.finish()]);
        self.read_texture(&one)
    }

    pub(crate) fn analyse(
        &self,
        prefilter: &GpuPrefilter,
        decoder: &GpuDecoder,
        latents: &[Latent],
    ) -> GpuHarmonics {
        let harmonics = prefilter.harmonics(latents.len() as u32).unwrap();
        let latents = decoder.condition_batch(&self.opened.queue, latents).unwrap();
        let mut encoder = self.opened.device.create_command_encoder(&Default::default());
        prefilter.analyse(&mut encoder, decoder, &latents, &harmonics).unwrap();
        self.opened.queue.submit([encoder.finish()]);
        harmonics
    }

    fn coefficients(&self, harmonics: &GpuHarmonics) -> Vec<[f64; 3]> {
        let found = read_back::buffer(&self.opened.device, &self.opened.queue, harmonics.coefficients());
        found.unwrap().into_iter().map(|rgb| rgb.map(f64::from)).collect()
    }
}

/// Root of the summed squares of differences over that of what is expected. A NaN counts as infinite.
pub(crate) fn relative<T: Copy + Into<f64>>(found: &[[T; 3]], expected: &[[f64; 3]]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let (mut off, mut whole) = (0.0, 0.0);
    for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
        off += ((*a).into() - b).powi(2);
        whole += b * b;
    }
    let relative = (off / whole).sqrt();
    if relative.is_nan() { f64::INFINITY } else { relative }
}

pub(crate) fn double(pixels: &[[f32; 3]]) -> Vec<[f64; 3]> {
    pixels.iter().map(|rgb| rgb.map(f64::from)).collect()
}

const FINE: Equirect = Equirect { width: 512, height: 256 };

/// Nine harmonics and all others against the projection of a fine panorama of the same field, by exact pixel areas.
#[test]
fn harmonics_are_those_of_the_panorama() {
    let Some(gpu) = plain() else { return };
    let model = pretrained();
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let latents = [19, 8].map(|seed| sky(&model, seed));
    let bake = |latent| model.decoder().unwrap().condition(latent).unwrap().bake(FINE);
    let skies = latents.each_ref().map(bake);
    let other = bake(&sky(&model, 5));
    let other = EnvironmentMap::new(FINE, &other).unwrap();
    for degree in [2, 24, GpuPrefilter::DEGREE] {
        let prefilter = GpuPrefilter::with_degree(&gpu.opened.device, degree).unwrap();
        let found = gpu.coefficients(&gpu.analyse(&prefilter, &decoder, &latents));
        let each = (degree + 1) * (degree + 1);
        for (found, pixels) in found.chunks_exact(each).zip(&skies) {
            let map = EnvironmentMap::new(FINE, pixels).unwrap();
            let nine = relative(&found[..9], Sh::<2>::of(map).coefficients());
            let all = match degree {
                2 => nine,
                24 => relative(found, Sh::<24>::of(map).coefficients()),
                _ => relative(found, Sh::<64>::of(map).coefficients()),
            };
            say(&format!(
                "degree {degree}: nine harmonics within {nine:.1e}, all within {all:.1e}, relative RMS"
            ));
            // what is beyond the largest degree comes back as a little of what is below it
            assert!(nine < 1e-3 && all < 4e-3, "degree {degree}: {nine:e} {all:e}");
            // of another sky they are far off
            assert!(relative(&found[..9], Sh::<2>::of(other).coefficients()) > 0.05);
        }
    }
}

/// Every level in every frame against the CPU's, whose spectrum goes to the degree that the narrowest lobe asks for.
#[test]
fn levels_are_those_of_the_cpu_in_every_frame() {
    let Some(gpu) = plain() else { return };
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    let model = pretrained();
    let decoder = GpuDecoder::new(device, &model).unwrap();
    let prefilter = GpuPrefilter::new(device).unwrap();
    let angle = 0.7;
    let [large, small] = [(64, 5), (16, 3)].map(|(size, count)| Levels::new(size, count, Law::Quadratic));
    let seeds = [8, 3];
    let latents = seeds.map(|seed| sky(&model, seed));
    let bake =
        |latent: &Latent| model.decoder().unwrap().condition(&latent.rotated(angle)).unwrap().bake(FINE);
    let pixels = latents.each_ref().map(bake);
    let skies = [0, 1].map(|k| {
        let conditioned = decoder.condition(queue, &latents[k]).unwrap();
        let harmonics = gpu.analyse(&prefilter, &decoder, &latents[k..=k]);
        let cpu = Prefilter::new(EnvironmentMap::new(FINE, &pixels[k]).unwrap(), &[large, small]);
        (seeds[k], conditioned, harmonics, cpu)
    });
    for (frame, format, levels, count, sky) in [
        (Frame::Blender, TextureFormat::Rgba32Float, large, 5, 0),
        (Frame::Blender, TextureFormat::Rgba32Float, large, 5, 1),
        (Frame::Gltf, TextureFormat::Rgba16Float, small, 3, 0),
        (Frame::OpenExr, TextureFormat::Rgba32Float, small, 3, 0),
        (Frame::Bevy, TextureFormat::Rgba32Float, small, 3, 0),
    ] {
        let ((seed, latents, harmonics, cpu), size) = (&skies[sky], levels.size(0));
        let chain = gpu.chain(format, size as u32, count as u32, 1);
        let cube = PrefilteredCube::new(&chain, Law::Quadratic).frame(frame).rotate(angle);
        let mut encoder = device.create_command_encoder(&Default::default());
        prefilter.bake(&mut encoder, &decoder, latents, harmonics, &cube).unwrap();
        queue.submit([encoder.finish()]);
        for level in 1..count {
            let p = levels.roughness(level);
            let found = gpu.level(&chain, level as u32);
            let expected = cpu.level(p, levels.size(level), CubeAxes::of(frame));
            let off = relative(&found, &double(expected.texels()));
            if frame == Frame::Blender {
                say(&format!(
                    "seed {seed}, p = {p:.3}, {} texels: relative RMSE {:.3} %",
                    levels.size(level),
                    100.0 * off
                ));
            }
            // halves have eleven bits; what the lobe keeps beyond degree 64 is missing
            assert!(off < if level == 1 { 0.01 } else { 2e-3 }, "{frame:?}, level {level}: {off:e}");
            // seen along other axes, or another way round, it is another cube
            // Bevy's are glTF's mirrored, which many a sky hardly shows
            let same_up = matches!(frame, Frame::Gltf | Frame::Bevy);
            let other = if same_up { CubeAxes::NATIVE } else { CubeAxes::GLTF };
            let other = cpu.level(p, levels.size(level), other);
            assert!(relative(&found, &double(other.texels())) > 0.3, "{frame:?}, level {level}");
        }
        // the first level is the field
        let first = gpu.level(&chain, 0);
        let direct = gpu.texture(format, [size as u32, size as u32, 6]);
        gpu.bake(&decoder, latents, &Bake::cube(&direct).frame(frame).rotate(angle));
        assert_eq!(first, gpu.read_texture(&direct));
    }
}

/// Chains down to one texel, whose last levels are means, of several latents at once; energy.
#[test]
fn small_faces_are_means_and_energy_is_kept() {
    let Some(gpu) = plain() else { return };
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    let model = filler(3, 32, 2);
    let decoder = GpuDecoder::new(device, &model).unwrap();
    let prefilter = GpuPrefilter::with_degree(device, 48).unwrap();
    let skies = [latent(3, 4), latent(3, 5)];
    let latents = decoder.condition_batch(queue, &skies).unwrap();
    let harmonics = gpu.analyse(&prefilter, &decoder, &skies);
    let (size, count) = (16, 5);
    let levels = Levels::new(size, count, Law::Linear);
    let chain = gpu.chain(TextureFormat::Rgba32Float, size as u32, count as u32, 2);
    let cube = PrefilteredCube::new(&chain, Law::Linear).frame(Frame::Bevy);
    let mut encoder = device.create_command_encoder(&Default::default());
    prefilter.bake(&mut encoder, &decoder, &latents, &harmonics, &cube).unwrap();
    queue.submit([encoder.finish()]);
    for (k, sky) in skies.iter().enumerate() {
        let pixels = model.decoder().unwrap().condition(sky).unwrap().bake(FINE);
        let cpu = Prefilter::new(EnvironmentMap::new(FINE, &pixels).unwrap(), &[levels]);
        for level in 1..count {
            let texels = 6 * levels.size(level).pow(2);
            let found = gpu.level(&chain, level as u32)[k * texels..][..texels].to_vec();
            let expected = cpu.level(levels.roughness(level), levels.size(level), CubeAxes::BEVY);
            let off = relative(&found, &double(expected.texels()));
            assert!(off < 5e-3, "latent {k}, level {level}: {off:e}");
            let cube = veni_light::light::CubeMap::new(levels.size(level), found);
            for (a, b) in cube.integral().into_iter().zip(cpu.integral()) {
                assert!((a / b - 1.0).abs() < 1e-3, "latent {k}, level {level}: {a} for {b}");
            }
        }
    }
}

#[test]
fn the_twin_is_the_cpus_spectrum() {
    let model = filler(3, 32, 2);
    let field = model.decoder().unwrap().condition(&latent(3, 4)).unwrap();
    let tables = SpectrumTables::new(40);
    let directions: Vec<_> = tables.directions.iter().map(|[x, y, z, _]| [*x, *y, *z]).collect();
    let mut radiance = vec![[0.0; 3]; directions.len()];
    field.radiance_batch(&directions, &mut radiance);
    let found = veni_degrees(&tables, &radiance);
    let pixels = field.bake(FINE);
    let map = EnvironmentMap::new(FINE, &pixels).unwrap();
    let off = relative(&found, Sh::<40>::of(map).coefficients());
    assert!(off < 5e-3, "{off:e}");
    // the level of roughness 1 is irradiance over π
    let gains = lobe_gains(1.0, 40);
    let sh = Sh::<40>::new(found.clone()).unwrap().irradiance();
    for n in crate::util::directions(50) {
        let a = veni_harmonics(&tables, &gains, &found, n.map(f64::from));
        for (a, b) in a.into_iter().zip(sh.value(n)) {
            assert!((a - b / std::f64::consts::PI).abs() < 1e-3 * b.abs(), "{n:?}: {a} for {b}/π");
        }
    }
}

/// The first level of a large chain, whose texels are narrower than its lobe: what the lobe keeps beyond the largest degree is
/// missing there, and less of it for a larger one.
#[test]
fn narrow_lobes_lack_what_is_beyond_the_largest_degree() {
    let model = pretrained();
    let levels = Levels::new(256, 5, Law::Quadratic);
    let (p, size) = (levels.roughness(1), levels.size(1));
    for seed in [19, 7] {
        let field = model.decoder().unwrap().condition(&sky(&model, seed)).unwrap();
        let grid = Equirect { width: 1024, height: 512 };
        let pixels = field.bake(grid);
        let cpu = Prefilter::new(EnvironmentMap::new(grid, &pixels).unwrap(), &[levels]);
        let expected = double(cpu.level(p, size, CubeAxes::NATIVE).texels());
        let expected: Vec<_> = expected.into_iter().step_by(37).collect();
        let centres = CubeFace::ALL.iter().flat_map(|face| face.directions(Frame::Blender, size)).step_by(37);
        let centres: Vec<_> = centres.collect();
        let off = [GpuPrefilter::DEGREE, 128].map(|degree| {
            let tables = SpectrumTables::new(degree);
            let directions: Vec<_> = tables.directions.iter().map(|[x, y, z, _]| [*x, *y, *z]).collect();
            let mut radiance = vec![[0.0; 3]; directions.len()];
            field.radiance_batch(&directions, &mut radiance);
            let coefficients = veni_degrees(&tables, &radiance);
            let gains = lobe_gains(p, degree);
            let value = |d: &[f32; 3]| {
                veni_harmonics(&tables, &gains, &coefficients, d.map(f64::from)).map(|v| v.max(0.0))
            };
            relative(&centres.iter().map(value).collect::<Vec<_>>(), &expected)
        });
        let [few, many] = off.map(|off| 100.0 * off);
        say(&format!("seed {seed}, p = {p:.3}, {size} texels: {few:.2} % by 64 degrees, {many:.2} % by 128"));
        assert!(off[0] < 0.03 && off[1] < 0.5 * off[0], "{off:?}");
    }
}

/// Deliberate mistakes in the texts, run as a host of another API would, that the comparison with the twin must catch.
#[test]
fn mistakes_are_noticed() {
    let Some(gpu) = plain() else { return };
    let work = crate::prefilter_by_hand::Work::new();
    let (spectrum, level) = (spectrum_source().to_owned(), level_source(StorageFormat::Rgba32Float));
    let off = work.off(&gpu, &spectrum, &level);
    assert!(off[0] < 2e-6 && off[1] < 2e-6, "unbroken: {off:?}");
    for (from, to) in [
        ("phase += order;", "phase += order + 1u;"),
        ("odd += phases[phase].y * value", "odd -= phases[phase].y * value"),
        ("select(0u, 1u, odd)", "0u"),
        ("(degree * (degree + 1u) / 2u + order)", "(degree * (degree + 1u) / 2u + degree - order)"),
        ("select(id.x - middle, middle - id.x, odd)", "select(middle - id.x, id.x - middle, odd)"),
        ("sum += lights[at].xyz", "sum -= lights[at].xyz"),
        ("rest[at] = vec4f(sum, 0.0);", "rest[at] = vec4f();"),
    ] {
        assert!(spectrum.contains(from), "the shader no longer has `{from}`: the break breaks nothing");
        let [harmonics, texels] = work.off(&gpu, &spectrum.replace(from, to), &level);
        let off = harmonics.max(texels);
        assert!(off > 5e-6, "`{to}` in place of `{from}` is not noticed: {off:e}");
    }
    for (from, to) in [
        ("d.z * q - step.y * before", "d.z * q + step.y * before"),
        ("diagonal *= -sqrt", "diagonal *= sqrt"),
        ("select(1.4142135, 1.0, m == 0u)", "1.0"),
        ("gains[level.gains + l]", "gains[l]"),
        ("l <= level.kept", "l < level.kept"),
        ("power.x * d.x - power.y * d.y", "power.x * d.x + power.y * d.y"),
        ("level.axis_y * v.y", "level.axis_y * -v.y"),
        ("id.z / 6u, d", "0u, d"),
        ("scale * scale * scale", "scale"),
        ("irradiance.xyz * value", "irradiance.xyz"),
        ("m < glints[latent].y", "m + 1u < glints[latent].y"),
        ("veni_glint_value(table, low + 1u)", "veni_glint_value(table, low)"),
        ("veni_glints(id.z / 6u, d)", "veni_glints(0u, d)"),
    ] {
        assert!(level.contains(from), "the shader no longer has `{from}`: the break breaks nothing");
        let [_, texels] = work.off(&gpu, &spectrum, &level.replace(from, to));
        assert!(texels > 5e-6, "`{to}` in place of `{from}` is not noticed: {texels:e}");
    }
}

#[test]
fn what_does_not_fit_is_named() {
    let Some(gpu) = plain() else { return };
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    let said = |error: veni_gpu::Error, words: &[&str]| {
        let message = error.to_string();
        assert!(words.iter().all(|word| message.contains(word)), "`{message}` does not say {words:?}");
    };
    for degree in [0, 1, 129] {
        said(GpuPrefilter::with_degree(device, degree).unwrap_err(), &[&degree.to_string(), "128"]);
    }
    let model = filler(3, 16, 1);
    let decoder = GpuDecoder::new(device, &model).unwrap();
    let [small, other] = [4, 8].map(|degree| GpuPrefilter::with_degree(device, degree).unwrap());
    said(small.harmonics(0).unwrap_err(), &["0 latents"]);
    said(small.harmonics(1 << 20).unwrap_err(), &["max_storage_buffer_binding_size"]);
    let workspace = small.harmonics(1).unwrap();
    let two = decoder.condition_batch(queue, &[latent(3, 1), latent(3, 2)]).unwrap();
    let one = decoder.condition(queue, &latent(3, 1)).unwrap();
    let mut encoder = device.create_command_encoder(&Default::default());
    said(small.analyse(&mut encoder, &decoder, &two, &workspace).unwrap_err(), &["2 latents", "workspace"]);
    said(other.analyse(&mut encoder, &decoder, &one, &workspace).unwrap_err(), &["degree 4", "8"]);
    let foreign = GpuDecoder::new(device, &filler(3, 8, 1)).unwrap();
    said(small.analyse(&mut encoder, &foreign, &one, &workspace).unwrap_err(), &["model"]);
    let flat = gpu.texture(TextureFormat::Rgba32Float, [8, 8, 1]);
    let bake = |encoder: &mut wgpu::CommandEncoder, cube: &PrefilteredCube<'_>| {
        small.bake(encoder, &decoder, &one, &workspace, cube).unwrap_err()
    };
    said(bake(&mut encoder, &PrefilteredCube::new(&flat, Law::Linear)), &["1 layers"]);
    let chain = gpu.chain(TextureFormat::Rgba32Float, 8, 2, 1);
    said(bake(&mut encoder, &PrefilteredCube::new(&chain, Law::Linear).rotate(f64::NAN)), &["NaN"]);
    // and what fits is still recorded
    small.analyse(&mut encoder, &decoder, &one, &workspace).unwrap();
    small.bake(&mut encoder, &decoder, &one, &workspace, &PrefilteredCube::new(&chain, Law::Linear)).unwrap();
    queue.submit([encoder.finish()]);
}
