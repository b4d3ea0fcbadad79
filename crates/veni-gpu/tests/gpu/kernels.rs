//! Kernels run by hand from `shader` alone, as a host of another API would: text, constants, bindings, packed buffers,
//! requests and dispatches. Other tests change the text on the way.

use veni_gpu::shader::twin::{Twin, listed, stored};
use veni_gpu::shader::{
    Binding, Directions, ENTRY_POINT, Grid, Kernel, Request, Sizes, Store, Variant, WeightPrecision,
    pack_latent, pack_model,
};
use veni_gpu::wgpu::{self, BufferUsages};
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::Frame;

use crate::util::{Gpu, agrees, difference, directions, filler, latent, plain};

/// A decoder and a latent, packed, with the directions of a list.
pub(crate) struct Work {
    pub(crate) twin: Twin,
    pub(crate) directions: Vec<[f32; 3]>,
    pub(crate) request: Request,
    /// What pixels gain from lights, if the directions are a grid's.
    pub(crate) gains: Vec<[u32; 4]>,
}

impl Work {
    pub(crate) fn new(model: &Model, latents: &[Latent], directions: Vec<[f32; 3]>) -> Self {
        let packed = pack_model(model);
        let mut blocks = Vec::new();
        for latent in latents {
            pack_latent(packed.sizes, &model.decoder().unwrap().condition(latent).unwrap(), &mut blocks)
                .unwrap();
        }
        let count = directions.len() as u32;
        let request = Request {
            grid: Grid::List { count },
            frame: Frame::Gltf,
            rotation: 0.4,
            log_exposure: 0.25,
            largest: f32::MAX,
            logarithm: true,
            lights: true,
            first: 0,
            count,
            latent: 0,
            tile: 0,
        };
        Self { twin: Twin::new(packed, blocks), directions, request, gains: vec![[0; 4]] }
    }

    /// What the twin stores for each direction.
    pub(crate) fn expected(&self) -> Vec<[f32; 3]> {
        let value = |d: &[f32; 3]| {
            let d = listed(&self.request, *d);
            let (log, lights) = (self.twin.veni_log_radiance_of(0, d), self.twin.veni_lights_of(0, d));
            stored(&self.request, log, lights).map(|v| v as f32)
        };
        self.directions.iter().map(value).collect()
    }

    /// Runs `source` with the variant's bindings and dispatches; the target has `size` vec4f.
    pub(crate) fn run(&self, gpu: &Gpu, variant: &Variant, source: &str, size: usize) -> Vec<[f32; 4]> {
        self.run_by(&variant.dispatches(self.request, 1), gpu, variant, source, size)
    }

    /// The same with dispatches of one's choice.
    fn run_by(
        &self,
        dispatches: &[(Request, [u32; 3])],
        gpu: &Gpu,
        variant: &Variant,
        source: &str,
        size: usize,
    ) -> Vec<[f32; 4]> {
        let device = &gpu.opened.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some(ENTRY_POINT),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &variant.constants(),
                ..Default::default()
            },
            cache: None,
        });
        let filled = |data: &[f32]| {
            let buffer = gpu.buffer(4 * data.len() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST);
            gpu.opened.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(data));
            buffer
        };
        let twin = &self.twin;
        let mut buffers = vec![filled(&twin.matrices), filled(&twin.vectors), filled(&twin.latents)];
        let uniform = gpu.buffer(Request::BYTES as u64, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
        let sixth = match variant.directions {
            Directions::Buffer => gpu.upload(&self.directions),
            Directions::Grid => filled(bytemuck::cast_slice(&self.gains)),
        };
        buffers.extend([uniform.clone(), gpu.pixels(size), sixth]);
        assert_eq!(variant.bindings()[3], Binding::Uniform);
        let entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        for (request, [x, y, z]) in dispatches {
            gpu.opened.queue.write_buffer(&uniform, 0, &request.to_bytes());
            let mut encoder = device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(*x, *y, *z);
            drop(pass);
            gpu.opened.queue.submit([encoder.finish()]);
        }
        gpu.read_all(&buffers[4])
    }

    /// The log radiance that `source` stores.
    pub(crate) fn log_radiance(&self, gpu: &Gpu, variant: &Variant, source: &str) -> Vec<[f32; 3]> {
        let all = self.run(gpu, variant, source, self.directions.len());
        all.into_iter().map(|[r, g, b, _]| [r, g, b]).collect()
    }
}

/// A list of directions to a buffer, by default limits.
pub(crate) fn list_variant(sizes: Sizes, kernel: Kernel) -> Variant {
    let (directions, store) = (Directions::Buffer, Store::Buffer);
    Variant { sizes, kernel, weights: WeightPrecision::Single, directions, store }
}

pub(crate) const TILED: Kernel = Kernel::Tiled { memory: 16_384, subgroups: false };

#[test]
fn a_host_without_our_host_side_gets_the_same_numbers() {
    let Some(gpu) = plain() else { return };
    let work = Work::new(&filler(9, 128, 6), &[latent(9, 3)], directions(150));
    for kernel in [TILED, Kernel::Each] {
        let variant = list_variant(work.twin.sizes, kernel);
        let off = difference(&work.log_radiance(&gpu, &variant, &variant.source()), &work.expected());
        assert!(agrees(off), "{kernel:?}: {off:?}");
    }
}

/// Narrow tiles of wide decoders need more workgroups than one dimension has. Here three tiles, and one too many.
#[test]
fn tiles_in_two_dimensions_and_in_several_dispatches() {
    let Some(gpu) = plain() else { return };
    let work = Work::new(&filler(3, 20, 2), &[latent(3, 3)], directions(150));
    for kernel in [TILED, Kernel::Each] {
        let variant = list_variant(work.twin.sizes, kernel);
        assert_eq!(variant.tile(), 64);
        let square = [(work.request, [2, 2, 1])];
        let parts = [(work.request, [1, 1, 1]), (Request { tile: 1, ..work.request }, [1, 3, 1])];
        for dispatches in [&square[..], &parts[..]] {
            let found = work.run_by(dispatches, &gpu, &variant, &variant.source(), 150);
            let found: Vec<_> = found.into_iter().map(|[r, g, b, _]| [r, g, b]).collect();
            let off = difference(&found, &work.expected());
            assert!(agrees(off), "{kernel:?}, {dispatches:?}: {off:?}");
        }
    }
}

/// Phases of hundreds of radians: what WGSL's own sine is not made for, and what lavapipe's hides.
#[test]
fn large_latents_keep_their_phase() {
    let Some(gpu) = plain() else { return };
    let mut large = latent(9, 3);
    // 4 · 2π · |z| reaches 750 radians
    large.vectors.iter_mut().for_each(|v| v[..2].iter_mut().for_each(|c| *c *= 10.0));
    let work = Work::new(&filler(9, 128, 6), &[large], directions(300));
    let longest = work.directions.iter().flat_map(|d| {
        let d = listed(&work.request, *d);
        (0..9).map(move |i| (i, d))
    });
    let radians = longest
        .map(|(i, d)| {
            8.0 * std::f64::consts::PI * veni_gpu::shader::twin::veni_encode(&work.twin, 0, i, d)[4]
        })
        .fold(0.0, |a: f64, b| a.max(b.abs()));
    assert!(radians > 300.0, "only {radians} radians");
    for kernel in [TILED, Kernel::Each] {
        let variant = list_variant(work.twin.sizes, kernel);
        let off = difference(&work.log_radiance(&gpu, &variant, &variant.source()), &work.expected());
        crate::util::say(&format!(
            "{radians:.0} radians, {kernel:?}: off by {:.1e} and {:.1e}",
            off.0, off.1
        ));
        assert!(agrees(off), "{kernel:?}: {off:?}");
    }
}
