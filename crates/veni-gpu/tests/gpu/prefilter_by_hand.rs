//! The kernels of harmonics and levels run from `shader` alone, as a host of another API would: text, tables, uniforms.

use veni_gpu::shader::twin::{veni_degrees, veni_glints, veni_harmonics};
use veni_gpu::shader::{
    Glints, LEVEL_ENTRY_POINT, Level, SPECTRUM_ENTRY_POINTS, SpectrumTables, pack_light_harmonics,
};
use veni_gpu::wgpu::{self, BufferUsages, TextureFormat};
use veni_light::light::{CompactLight, Lights, lobe_gains};
use veni_light::sphere::{CubeFace, Frame};

use crate::util::Gpu;

const DEGREE: usize = 6;
const SIZE: u32 = 3;
/// Latents; what their radiance is does not matter here, but they differ.
const LATENTS: usize = 2;

/// Radiance of two latents on rings, and what the twin makes of it.
pub(crate) struct Work {
    tables: SpectrumTables,
    radiance: Vec<[f32; 4]>,
    gains: Vec<f64>,
    level: Level,
    /// Lights of each latent, which are not in its radiance.
    lights: [Lights; LATENTS],
    glints: Vec<[u32; 4]>,
    /// Lights included.
    coefficients: Vec<[f64; 3]>,
    texels: Vec<[f64; 3]>,
}

impl Work {
    pub(crate) fn new() -> Self {
        let tables = SpectrumTables::new(DEGREE);
        // smooth, without symmetry
        let value = |k: usize, [x, y, z, _]: [f32; 4]| {
            let t = k as f32;
            [
                1.0 + 0.5 * x - 0.3 * y * z + t * y,
                2.0 + z * x * x * y + 0.2 * y,
                (0.8 * x + 0.3 * y - t * z).exp(),
            ]
        };
        let radiance: Vec<[f32; 3]> =
            (0..LATENTS).flat_map(|k| tables.directions.iter().map(move |d| value(k, *d))).collect();
        let each = tables.directions.len();
        let coefficients: Vec<_> =
            radiance.chunks_exact(each).flat_map(|r| veni_degrees(&tables, r)).collect();
        // a lobe that keeps all degrees
        let gains = lobe_gains(0.4, DEGREE);
        let light = |d, radius| CompactLight::new(d, [0.3, 0.2, 0.4], radius);
        let lights = [
            Lights::new(None, [light([0.0, 0.6, 0.8], 0.3)]),
            Lights::new(Some(light([0.48, -0.6, 0.64], 0.1)), [light([0.0, 0.0, -1.0], 0.01)]),
        ];
        let glints = Glints::new(0.4).pack(&lights);
        let samples = 2;
        let level = Level {
            size: SIZE,
            frame: Frame::Gltf,
            rotation: 0.4,
            degree: DEGREE as u32,
            kept: gains.len() as u32 - 1,
            gains: 3,
            samples,
            largest: f32::MAX,
        };
        let (sin, cos) = (-level.rotation).sin_cos();
        let n = SIZE * samples;
        let mut texels = Vec::new();
        for (latent, own) in coefficients.chunks_exact(tables.coefficients()).enumerate() {
            for (face, texel) in CubeFace::ALL.iter().flat_map(|f| (0..SIZE * SIZE).map(move |t| (f, t))) {
                let (mut sum, mut whole) = ([0.0; 3], 0.0);
                for s in 0..samples * samples {
                    let place = |at: u32, s: u32| f64::from(2 * (at * samples + s) + 1) / f64::from(n) - 1.0;
                    let v = face.lookup(place(texel % SIZE, s % samples), place(texel / SIZE, s / samples));
                    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
                    let [x, y, z] = Frame::Gltf.to_native(v.map(|c| (c / length) as f32)).map(f64::from);
                    let d = [x * cos - y * sin, x * sin + y * cos, z];
                    let (value, weight) = (veni_harmonics(&tables, &gains, own, d), length.powi(-3));
                    let more = veni_glints(&glints, latent, d);
                    sum = [0, 1, 2].map(|c| sum[c] + weight * (value[c] + more[c]));
                    whole += weight;
                }
                texels.push(sum.map(|s| (s / whole).max(0.0)));
            }
        }
        let radiance = radiance.into_iter().map(|[r, g, b]| [r, g, b, f32::NAN]).collect();
        let added = pack_light_harmonics(DEGREE, &lights);
        let whole = |(rest, added): (&[f64; 3], &[f32; 4])| [0, 1, 2].map(|c| rest[c] + f64::from(added[c]));
        let coefficients = coefficients.iter().zip(&added).map(whole).collect();
        Self { tables, radiance, gains, level, lights, glints, coefficients, texels }
    }

    /// Relative RMS differences of harmonics and of texels from the twin's.
    pub(crate) fn off(&self, gpu: &Gpu, spectrum: &str, level: &str) -> [f64; 2] {
        let tables = &self.tables;
        let filled = |bytes: &[u8], usage: BufferUsages| {
            let buffer = gpu.buffer(bytes.len() as u64, usage | BufferUsages::COPY_DST);
            gpu.opened.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let storage = |bytes: &[u8]| filled(bytes, BufferUsages::STORAGE);
        // in front of this level's gains stand those of others
        let gains: Vec<f32> =
            [7.0, 8.0, 9.0].into_iter().chain(self.gains.iter().map(|g| *g as f32)).collect();
        let phases = storage(bytemuck::cast_slice(&tables.phases));
        let legendre = storage(bytemuck::cast_slice(&tables.legendre));
        let radiance = storage(bytemuck::cast_slice(&self.radiance));
        let waves = gpu.pixels(LATENTS * tables.waves());
        let [rest, coefficients] = [(); 2].map(|()| gpu.pixels(LATENTS * tables.coefficients()));
        let lights = storage(bytemuck::cast_slice(&pack_light_harmonics(DEGREE, &self.lights)));
        let rings = filled(&tables.to_bytes(), BufferUsages::UNIFORM);
        let orders = DEGREE as u32 + 1;
        let module = module(gpu, spectrum);
        // each entry point uses some of the bindings
        let of_waves = vec![(0, &rings), (1, &phases), (3, &radiance), (4, &waves)];
        let of_degrees =
            vec![(0, &rings), (2, &legendre), (4, &waves), (5, &rest), (6, &lights), (7, &coefficients)];
        let groups = [orders * tables.rings as u32, orders * orders].map(|n| n.div_ceil(64));
        for ((entry, buffers), groups) in SPECTRUM_ENTRY_POINTS.iter().zip([of_waves, of_degrees]).zip(groups)
        {
            let resources: Vec<_> =
                buffers.into_iter().map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
            run(gpu, &module, entry, &resources, [groups, 1, LATENTS as u32]);
        }
        let texture = gpu.texture(TextureFormat::Rgba32Float, [SIZE, SIZE, 6 * LATENTS as u32]);
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        let uniform = filled(&self.level.to_bytes(), BufferUsages::UNIFORM);
        let (steps, gains) =
            (storage(bytemuck::cast_slice(&tables.steps)), storage(bytemuck::cast_slice(&gains)));
        let glints = storage(bytemuck::cast_slice(&self.glints));
        let buffers = [(0, &uniform), (1, &steps), (2, &gains), (3, &rest), (5, &glints)];
        let mut resources: Vec<_> =
            buffers.map(|(binding, buffer)| (binding, buffer.as_entire_binding())).into();
        resources.push((4, wgpu::BindingResource::TextureView(&view)));
        let module = self::module(gpu, level);
        run(
            gpu,
            &module,
            LEVEL_ENTRY_POINT,
            &resources,
            [SIZE.div_ceil(8), SIZE.div_ceil(8), 6 * LATENTS as u32],
        );
        [
            relative(&gpu.read(&coefficients), &self.coefficients),
            relative(&gpu.read_texture(&texture), &self.texels),
        ]
    }
}

fn relative(found: &[[f32; 3]], expected: &[[f64; 3]]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let (mut off, mut whole) = (0.0, 0.0);
    for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
        off += (f64::from(*a) - b).powi(2);
        whole += b * b;
    }
    let relative = (off / whole).sqrt();
    if relative.is_nan() { f64::INFINITY } else { relative }
}

fn module(gpu: &Gpu, source: &str) -> wgpu::ShaderModule {
    gpu.opened.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source.into()),
    })
}

fn run(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    entry: &str,
    resources: &[(u32, wgpu::BindingResource<'_>)],
    [x, y, z]: [u32; 3],
) {
    let device = &gpu.opened.device;
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let entries: Vec<_> = resources
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(x, y, z);
    drop(pass);
    gpu.opened.queue.submit([encoder.finish()]);
}
