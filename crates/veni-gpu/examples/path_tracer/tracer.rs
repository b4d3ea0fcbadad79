//! The pipeline, its bindings and its submissions: what a host writes around the texts.

use std::time::Instant;

use veni_gpu::adapters::Opened;
use veni_gpu::shader::{self, WeightPrecision};
use veni_gpu::wgpu::{self, BufferUsages};
use veni_gpu::{GpuDecoder, GpuLatents, GpuLight, read_back};

use crate::Result;
use crate::options::{Options, Strategy};
use crate::scene::{SPHERES, Sphere, VIEW_WORDS, view};

/// Paths of a submission: work in small portions, so that no driver's watchdog takes it for a hang.
const PATHS: u32 = 1 << 17;
/// Side of a workgroup in `tracer.wgsl`.
const TILE: u32 = 8;

/// What lights the scene.
pub(crate) struct Sky {
    /// By luminance, and compensated for the balance heuristic.
    pub(crate) lights: [GpuLight; 2],
    /// The field; without it the sky is the map that the lights were made of.
    pub(crate) field: Option<(GpuDecoder, GpuLatents)>,
}

impl Sky {
    /// What stands in front of `tracer.wgsl`: the functions and where their buffers are bound.
    fn text(&self) -> String {
        let light = format!("{}{}", shader::light_bindings(0, 0), shader::light());
        let Some((decoder, _)) = &self.field else {
            return format!("{light}\nfn sky(d: vec3f) -> vec3f {{ return veni_light_radiance(d); }}\n");
        };
        let enable = if decoder.weights() == WeightPrecision::Half { "enable f16;\n" } else { "" };
        let (bindings, field) =
            (shader::field_bindings(2, 0, decoder.weights()), shader::field(decoder.sizes()));
        format!(
            "{enable}{bindings}{field}{light}\nfn sky(d: vec3f) -> vec3f {{ return veni_radiance(d); }}\n"
        )
    }
}

/// Pipeline and bindings of one scene.
pub(crate) struct Tracer<'a> {
    opened: &'a Opened,
    size: [u32; 2],
    diffuse: bool,
    pipeline: wgpu::ComputePipeline,
    lights: [wgpu::BindGroup; 2],
    field: Option<wgpu::BindGroup>,
    scene: wgpu::BindGroup,
    view: wgpu::Buffer,
    picture: wgpu::Buffer,
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(opened: &'a Opened, sky: &Sky, options: &Options) -> Self {
        let (Opened { device, queue, .. }, size) = (opened, options.size);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("path tracer"),
            source: wgpu::ShaderSource::Wgsl((sky.text() + include_str!("tracer.wgsl")).into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("path tracer"),
            layout: None,
            module: &module,
            entry_point: Some("trace"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let group = |index: u32, buffers: &[&wgpu::Buffer]| {
            let entries = (0..).zip(buffers);
            let entries: Vec<_> = entries
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("path tracer"),
                layout: &pipeline.get_bind_group_layout(index),
                entries: &entries,
            })
        };
        let lights = [0, 1].map(|k| &sky.lights[k]).map(|l| group(0, &[l.uniform(), l.cells(), l.texels()]));
        let field = sky
            .field
            .as_ref()
            .map(|(decoder, latents)| group(2, &[decoder.matrices(), decoder.vectors(), latents.buffer()]));

        // the tracer's own buffers
        let buffer = |size: usize, usage: BufferUsages| {
            let (size, label) = (size as u64, Some("path tracer"));
            device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
        };
        let words = SPHERES.map(Sphere::words);
        let spheres = buffer(size_of_val(&words), BufferUsages::STORAGE | BufferUsages::COPY_DST);
        queue.write_buffer(&spheres, 0, bytemuck::cast_slice(&words));
        let view = buffer(4 * VIEW_WORDS, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
        let pixels = size[0] as usize * size[1] as usize;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let picture = buffer(16 * pixels, usage);
        let scene = group(1, &[&view, &spheres, &picture]);
        Self { opened, size, diffuse: options.compare, pipeline, lights, field, scene, view, picture }
    }

    /// The mean of this many paths per pixel, and the seconds that they took.
    pub(crate) fn trace(&self, strategy: Strategy, samples: u32, seed: u32) -> Result<(Vec<[f32; 3]>, f64)> {
        let [width, height] = self.size;
        let rows = (PATHS / width / TILE * TILE).max(TILE);
        let mut encoder = self.opened.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.picture, 0, None);
        self.opened.queue.submit([encoder.finish()]);
        let started = Instant::now();
        for sample in 0..samples {
            for first_row in (0..height).step_by(rows as usize) {
                let uniform =
                    view(self.size, sample, first_row, [strategy as u32, seed, u32::from(self.diffuse)]);
                self.submit(strategy, &uniform, rows.min(height - first_row));
                self.opened.device.poll(wgpu::PollType::wait_indefinitely())?;
            }
            let seconds = started.elapsed().as_secs_f64();
            eprint!("\r{}: {} of {samples} samples, {seconds:.1} s", strategy.name(), sample + 1);
        }
        let seconds = started.elapsed().as_secs_f64();
        let paths = f64::from(samples) * f64::from(width) * f64::from(height);
        eprintln!(", {:.0} paths/s", paths / seconds);
        let sums = read_back::buffer(&self.opened.device, &self.opened.queue, &self.picture)?;
        Ok((sums.into_iter().map(|rgb| rgb.map(|v| v / samples as f32)).collect(), seconds))
    }

    fn submit(&self, strategy: Strategy, uniform: &[u32; VIEW_WORDS], rows: u32) {
        let Opened { device, queue, .. } = self.opened;
        queue.write_buffer(&self.view, 0, bytemuck::cast_slice(uniform));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.lights[usize::from(strategy == Strategy::Mis)], &[]);
        pass.set_bind_group(1, &self.scene, &[]);
        if let Some(field) = &self.field {
            pass.set_bind_group(2, field, &[]);
        }
        pass.dispatch_workgroups(self.size[0].div_ceil(TILE), rows.div_ceil(TILE), 1);
        drop(pass);
        queue.submit([encoder.finish()]);
    }
}
