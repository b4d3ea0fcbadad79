//! The light's functions on the GPU against their twin, and the twin against `veni_light::light`.

mod breaks;
mod device;
mod twin;

use veni_gpu::GpuLight;
use veni_gpu::shader::twin::{LightTwin, VeniLightSample};
use veni_gpu::shader::{self, LightDensity, PackedLight, pack_light};
use veni_gpu::wgpu::{self, BufferUsages};
use veni_light::light::{CompactLight, EnvironmentMap, Light, LightOptions, Sampler, SplitSampler};
use veni_light::random::Stream;
use veni_light::sphere::Equirect;

use crate::util::{Gpu, directions};

const GRID: Equirect = Equirect { width: 256, height: 128 };

fn disc(direction: [f32; 3], irradiance: [f32; 3], radius: f32) -> CompactLight {
    CompactLight::new(direction, irradiance, radius)
}

/// A sky with a dark half, a sun, a lamp below the horizon's height and a black pixel.
fn pixels() -> Vec<[f32; 3]> {
    let mut pixels: Vec<[f32; 3]> = (GRID.directions().into_iter())
        .map(|[x, y, z]| {
            [0.4 + 0.3 * z + 0.1 * x, 0.5 + 0.3 * z, 0.8 + 0.4 * z + 0.1 * y]
                .map(|v: f32| if z < 0.0 { 0.1 * v } else { v })
        })
        .collect();
    disc([0.48, -0.6, 0.64], [6.0, 5.0, 4.0], 0.02).add_to(GRID, &mut pixels);
    disc([-0.8, 0.598, 0.05], [0.5, 0.6, 0.9], 0.05).add_to(GRID, &mut pixels);
    pixels[9000] = [0.0; 3];
    pixels
}

struct Sky {
    name: &'static str,
    light: Light,
    density: LightDensity,
}

/// A sun with a lamp, the same compensated and not split, one bright pixel beside a pole, darkness, a sun of 17°.
fn skies() -> Vec<Sky> {
    let whole = LightOptions { lights: 0, ..LightOptions::default() };
    let of = |pixels: &[[f32; 3]]| whole.of(EnvironmentMap::new(GRID, pixels).unwrap()).unwrap();
    let split = Light::of(EnvironmentMap::new(GRID, &pixels()).unwrap());
    assert!(split.sun().is_some() && split.lights().len() > 1, "{:?}", split.lights());
    let mut one = vec![[0.0; 3]; GRID.len()];
    one[77] = [5.0, 4.0, 3.0];
    let wide = LightOptions { sun_radius: Some(0.3), ..LightOptions::default() };
    let wide = wide.of(EnvironmentMap::new(GRID, &pixels()).unwrap()).unwrap();
    let sky = |name, light, density| Sky { name, light, density };
    vec![
        sky("sun and lamp", split.clone(), LightDensity::Luminance),
        sky("compensated", split, LightDensity::Compensated),
        sky("not split", of(&pixels()), LightDensity::Luminance),
        sky("one pixel", of(&one), LightDensity::Luminance),
        sky("black", of(&vec![[0.0; 3]; GRID.len()]), LightDensity::Luminance),
        sky("wide sun", wide, LightDensity::Luminance),
    ]
}

impl Sky {
    fn packed(&self) -> PackedLight {
        pack_light(&self.light, self.density).unwrap()
    }
}

/// The CPU's sampler of a sky, rotated.
enum Cpu<'a> {
    Split(SplitSampler<'a>),
    Map(Sampler<'a>),
}

impl<'a> Cpu<'a> {
    fn new(sky: &Sky, pixels: &'a [[f32; 3]], angle: f32) -> Self {
        let sampler = Sampler::new(EnvironmentMap::new(GRID, pixels).unwrap()).rotated(angle);
        let sampler = if sky.density == LightDensity::Compensated { sampler.compensated() } else { sampler };
        match sky.light.sun() {
            Some(sun) => Self::Split(SplitSampler::new(sun.rotated(f64::from(angle)), sampler)),
            None => Self::Map(sampler),
        }
    }

    fn sample(&self, u: [f32; 2]) -> VeniLightSample {
        let sample = match self {
            Self::Split(sampler) => sampler.sample(u),
            Self::Map(sampler) => sampler.sample(u),
        };
        VeniLightSample { direction: sample.direction, pdf: sample.pdf, radiance: sample.radiance }
    }

    fn pdf(&self, direction: [f32; 3]) -> f32 {
        match self {
            Self::Split(sampler) => sampler.pdf(direction),
            Self::Map(sampler) => sampler.pdf(direction),
        }
    }
}

fn numbers(count: usize) -> Vec<[f32; 2]> {
    let mut stream = Stream::from_seed(7);
    let mut number = || (stream.next_u32() >> 8) as f32 / (1 << 24) as f32;
    (0..count).map(|_| [number(), number()]).collect()
}

fn relative(a: f32, b: f32) -> f32 {
    if a == b { 0.0 } else { (a - b).abs() / b.abs().max(f32::MIN_POSITIVE) }
}

fn apart(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// How many of many samples are not the same, last bits aside: another pixel was chosen or found.
fn others(found: &[VeniLightSample], expected: impl Fn(usize) -> VeniLightSample) -> usize {
    let differ = |(k, a): (usize, &VeniLightSample)| {
        let b = expected(k);
        let same = apart(a.direction, b.direction) < 3e-6
            && relative(a.pdf, b.pdf) < 1e-5
            && a.radiance.iter().zip(b.radiance).all(|(a, b)| relative(*a, b) < 1e-5);
        !same
    };
    found.iter().enumerate().filter(|(k, a)| differ((*k, a))).count()
}

/// How many of 4096 samples may fall on the other side of a comparison of rounded numbers.
const FEW: usize = 4;

/// Runs `body` for each input, which writes two vec4f; `text` is the functions'.
fn run(gpu: &Gpu, light: &GpuLight, text: &str, body: &str, inputs: &[[f32; 4]]) -> Vec<[[f32; 4]; 2]> {
    let device = &gpu.opened.device;
    let source = format!(
        "{}{text}
@group(1) @binding(0) var<storage, read> inputs: array<vec4f>;
@group(1) @binding(1) var<storage, read_write> outputs: array<vec4f>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {{
    if id.x >= arrayLength(&inputs) {{
        return;
    }}
    if veni_light.cells == 0u {{
        // never: keeps bindings that a function does not use
        outputs[0] = vec4f(f32(veni_light_cells[0].x)) + veni_light_texels[0];
    }}
    let given = inputs[id.x];
    var first = vec4f();
    var second = vec4f();
    {body}
    outputs[2u * id.x] = first;
    outputs[2u * id.x + 1u] = second;
}}
",
        shader::light_bindings(0, 0)
    );
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let from = gpu.buffer(16 * inputs.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST);
    gpu.opened.queue.write_buffer(&from, 0, bytemuck::cast_slice(inputs));
    let to = gpu.pixels(2 * inputs.len());
    let group = |index: u32, buffers: &[&wgpu::Buffer]| {
        let entries = (0..).zip(buffers);
        let entries: Vec<_> = entries
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = &pipeline.get_bind_group_layout(index);
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    };
    let groups = [group(0, &[light.uniform(), light.cells(), light.texels()]), group(1, &[&from, &to])];
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    (0..).zip(&groups).for_each(|(index, group)| pass.set_bind_group(index, group, &[]));
    pass.dispatch_workgroups((inputs.len() as u32).div_ceil(64), 1, 1);
    drop(pass);
    gpu.opened.queue.submit([encoder.finish()]);
    gpu.read_all(&to).as_chunks::<2>().0.to_vec()
}

const SAMPLE: &str = "let s = veni_sample_light(given.xy); first = vec4f(s.direction, s.pdf); second = vec4f(s.radiance, 0.0);";
const SUN: &str =
    "let s = veni_sun(given.xy); first = vec4f(s.direction, s.pdf); second = vec4f(s.radiance, 0.0);";
const SEEN: &str =
    "first.x = veni_light_pdf(given.xyz); second = vec4f(veni_light_radiance(given.xyz), 0.0);";
const IRRADIANCE: &str = "first = vec4f(veni_irradiance(given.xyz), 0.0);";
const PLACE: &str = "let p = veni_light_place(given.xy); first = vec4f(f32(p.pixel), p.at, 0.0);";

fn sampled([first, second]: &[[f32; 4]; 2]) -> VeniLightSample {
    let [x, y, z, pdf] = *first;
    VeniLightSample { direction: [x, y, z], pdf, radiance: [second[0], second[1], second[2]] }
}

fn given(us: &[[f32; 2]]) -> Vec<[f32; 4]> {
    us.iter().map(|[u, v]| [*u, *v, 0.0, 0.0]).collect()
}

fn along(directions: &[[f32; 3]]) -> Vec<[f32; 4]> {
    directions.iter().map(|[x, y, z]| [*x, *y, *z, 0.0]).collect()
}

/// What differs between the GPU with this text and the twin, in the first sky; `None` if nothing does.
fn differs(gpu: &Gpu, sky: &Sky, packed: &PackedLight, text: &str, angle: f64) -> Option<String> {
    let light = GpuLight::new(&gpu.opened.device, packed).unwrap();
    light.rotate(&gpu.opened.queue, angle).unwrap();
    let twin = LightTwin::new(sky.packed()).rotated(angle);
    let us = numbers(4096);
    let places = run(gpu, &light, text, PLACE, &given(&us));
    let pixels =
        (places.iter().zip(&us)).filter(|([place, _], u)| place[0] as usize != twin.veni_light_place(**u).0);
    let pixels = pixels.count();
    if pixels > FEW {
        return Some(format!("{pixels} pixels"));
    }
    for (name, body) in [("samples", SAMPLE), ("samples of the sun", SUN)] {
        let found: Vec<_> = run(gpu, &light, text, body, &given(&us)).iter().map(sampled).collect();
        let one = |u| if body == SUN { twin.veni_sun(u) } else { twin.veni_sample_light(u) };
        let count = others(&found, |k| one(us[k]));
        if count > FEW {
            return Some(format!("{count} {name}"));
        }
    }
    // everywhere, and within the sun's disc
    let mut looks = directions(3000);
    looks.extend(us.iter().take(500).map(|u| twin.veni_sun(*u).direction));
    let seen = run(gpu, &light, text, SEEN, &along(&looks));
    let wrong = seen.iter().zip(&looks).filter(|([pdf, radiance], d)| {
        relative(pdf[0], twin.veni_light_pdf(**d)) > 1e-5
            || (0..3).any(|c| relative(radiance[c], twin.veni_light_radiance(**d)[c]) > 1e-5)
    });
    let wrong = wrong.count();
    // on the rim of the disc and on edges of pixels rounding decides
    if wrong > 3 * FEW {
        return Some(format!("{wrong} densities"));
    }
    let scale = sky.light.mean().into_iter().fold(1e-6, f32::max) * std::f32::consts::PI;
    let found = run(gpu, &light, text, IRRADIANCE, &along(&looks));
    let off = found
        .iter()
        .zip(&looks)
        .map(|([e, _], n)| apart([e[0], e[1], e[2]], twin.veni_irradiance(*n)) / scale);
    let off = off.fold(0f32, |worst, off| if off.is_nan() { f32::INFINITY } else { off.max(worst) });
    (off > 1e-5).then(|| format!("irradiance by {off:.1e}"))
}
