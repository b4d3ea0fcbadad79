//! From harmonics to levels.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use veni_light::light::{Levels, lobe_gains};
use wgpu::{
    BindGroupLayout, BindingResource, Buffer, BufferBinding, BufferSize, BufferUsages, CommandEncoder,
    ComputePassDescriptor, ComputePipeline, Device, TextureFormat, TextureViewDescriptor,
    TextureViewDimension,
};

use super::layout::{Access, group, layout, module, pipeline};
use super::{GpuHarmonics, GpuPrefilter, PrefilteredCube};
use crate::buffers::{filled, storage};
use crate::decoder::{GpuDecoder, GpuLatents};
use crate::error::{Error, Result};
use crate::scope::guarded;
use crate::shader::{Glints, LEVEL_ENTRY_POINT, Level, StorageFormat, level_source};

/// Most layers that a dispatch covers: WebGPU's limit on its third dimension.
const MAX_LAYERS: u32 = 65_535;

/// What does not depend on a latent, made when first needed.
#[derive(Debug, Default)]
pub(super) struct Chains(Mutex<Known>);

#[derive(Debug, Default)]
struct Known {
    kernels: HashMap<StorageFormat, Arc<Kernel>>,
    gains: Vec<(Levels, Arc<Gains>)>,
}

#[derive(Debug)]
struct Kernel {
    layout: BindGroupLayout,
    pipeline: ComputePipeline,
}

/// The gains of all levels of a chain but the first: where each begins, and its largest degree.
#[derive(Debug)]
struct Gains {
    buffer: Buffer,
    levels: Vec<[u32; 2]>,
    /// What the lobes make of lights, one for each level, made for the first latent that has some.
    glints: Mutex<Vec<Glints>>,
}

impl GpuPrefilter {
    /// Records a cube map of `latents`: the first level decoded directly, the others from their `harmonics`, which
    /// [`GpuPrefilter::analyse`] has filled. Nothing is submitted.
    ///
    /// Level k holds L convolved with the GGX lobe of its roughness, seen along its own normal, as
    /// [`Prefilter`](veni_light::light::Prefilter) on the CPU, up to the largest degree of the harmonics; lights, to which this limit
    /// does not apply, as the lobe shows them.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the texture does not fit (format, usage, size, layers), the harmonics are of another degree or of fewer
    /// latents; [`Error::Gpu`] if the device fails to make a resource. Nothing is recorded then.
    pub fn bake(
        &self,
        encoder: &mut CommandEncoder,
        decoder: &GpuDecoder,
        latents: &GpuLatents,
        harmonics: &GpuHarmonics,
        cube: &PrefilteredCube<'_>,
    ) -> Result<()> {
        self.check(latents, harmonics)?;
        let (levels, format) = cube.levels(latents.len())?;
        let layers = latents.len().saturating_mul(6);
        if layers > MAX_LAYERS {
            return Err(Error::invalid(format!("{layers} faces at a time: at most {MAX_LAYERS}")));
        }
        let (kernel, gains) = self.chains.get(&self.device, levels, format, self.degree())?;
        let alignment = self.device.limits().min_uniform_buffer_offset_alignment;
        let stride = (Level::BYTES as u32).next_multiple_of(alignment);
        let requests = self.requests(levels, format, &gains, cube, stride)?;
        let glints = self.glints(levels, &gains, latents, cube)?;
        let groups = (1..levels.count() as u32).zip(&glints).map(|(level, glints)| {
            let view = self.view(cube, level)?;
            let uniform =
                BufferBinding { buffer: &requests, offset: 0, size: BufferSize::new(Level::BYTES as u64) };
            let resources = vec![
                BindingResource::Buffer(uniform),
                self.tables.steps.as_entire_binding(),
                gains.buffer.as_entire_binding(),
                harmonics.rest().as_entire_binding(),
                BindingResource::TextureView(&view),
                glints.as_entire_binding(),
            ];
            guarded(&self.device, "bindings of a level", || group(&self.device, &kernel.layout, resources))
        });
        let groups = groups.collect::<Result<Vec<_>>>()?;
        decoder.bake(encoder, latents, &cube.first())?;
        let descriptor = ComputePassDescriptor { label: Some("veni levels"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&kernel.pipeline);
        for (level, group) in (1..).zip(&groups) {
            pass.set_bind_group(0, group, &[(level as u32 - 1) * stride]);
            let across = (levels.size(level) as u32).div_ceil(8);
            pass.dispatch_workgroups(across, across, layers);
        }
        Ok(())
    }

    /// The lights of all levels but the first.
    fn glints(
        &self,
        levels: Levels,
        gains: &Gains,
        latents: &GpuLatents,
        cube: &PrefilteredCube<'_>,
    ) -> Result<Vec<Buffer>> {
        let dark = !cube.lights || latents.with_lights(|all| all.iter().all(|lights| lights.is_empty()));
        if dark {
            return Ok(vec![self.no_lights.clone(); gains.levels.len()]);
        }
        // a panic elsewhere leaves tables as they were
        let mut glints = gains.glints.lock().unwrap_or_else(PoisonError::into_inner);
        if glints.is_empty() {
            glints.extend((1..levels.count()).map(|level| Glints::new(levels.roughness(level))));
        }
        let of_level = |glints: &mut Glints| {
            let packed = latents.with_lights(|lights| glints.pack(lights));
            storage(&self.device, "veni lights of a level", bytemuck::cast_slice(&packed))
        };
        glints.iter_mut().map(of_level).collect()
    }

    /// The uniforms of all levels but the first.
    fn requests(
        &self,
        levels: Levels,
        format: StorageFormat,
        gains: &Gains,
        cube: &PrefilteredCube<'_>,
        stride: u32,
    ) -> Result<Buffer> {
        let mut bytes = Vec::new();
        for (level, [first, kept]) in (1..).zip(&gains.levels) {
            let size = levels.size(level) as u32;
            let level = Level {
                size,
                frame: cube.frame,
                rotation: cube.rotation,
                degree: self.degree() as u32,
                kept: *kept,
                gains: *first,
                samples: Level::samples(size, levels.roughness(level), *kept),
                largest: format.largest(),
            };
            bytes.extend(level.to_bytes());
            bytes.resize(bytes.len().next_multiple_of(stride as usize), 0);
        }
        // a buffer has bytes even where there is nothing to do
        bytes.resize(bytes.len().max(stride as usize), 0);
        filled(&self.device, "veni levels", BufferUsages::UNIFORM, &bytes)
    }

    fn view(&self, cube: &PrefilteredCube<'_>, level: u32) -> Result<wgpu::TextureView> {
        let descriptor = TextureViewDescriptor {
            label: Some("veni level"),
            dimension: Some(TextureViewDimension::D2Array),
            base_mip_level: level,
            mip_level_count: Some(1),
            ..TextureViewDescriptor::default()
        };
        guarded(&self.device, "view of a level", || cube.texture.create_view(&descriptor))
    }
}

impl Chains {
    fn get(
        &self,
        device: &Device,
        levels: Levels,
        format: StorageFormat,
        degree: usize,
    ) -> Result<(Arc<Kernel>, Arc<Gains>)> {
        // a panic elsewhere leaves the map as it was
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let kernel = match known.kernels.get(&format) {
            Some(kernel) => Arc::clone(kernel),
            None => {
                let kernel = Arc::new(guarded(device, "veni level", || Kernel::new(device, format))?);
                known.kernels.insert(format, Arc::clone(&kernel));
                kernel
            }
        };
        if let Some((_, gains)) = known.gains.iter().find(|(chain, _)| *chain == levels) {
            return Ok((kernel, Arc::clone(gains)));
        }
        let gains = Arc::new(Gains::new(device, levels, degree)?);
        known.gains.push((levels, Arc::clone(&gains)));
        Ok((kernel, gains))
    }
}

impl Kernel {
    fn new(device: &Device, format: StorageFormat) -> Self {
        let texture = match format {
            StorageFormat::Rgba32Float => TextureFormat::Rgba32Float,
            StorageFormat::Rgba16Float => TextureFormat::Rgba16Float,
        };
        let uniform = Access::Uniform { bytes: Level::BYTES as u64, dynamic: true };
        let (read, texture) = (Access::Read, Access::Texture(texture));
        let accesses = [uniform, read, read, read, texture, read];
        let layout = layout(device, &accesses);
        let module = module(device, &level_source(format));
        let pipeline = pipeline(device, &layout, &module, LEVEL_ENTRY_POINT);
        Self { layout, pipeline }
    }
}

impl Gains {
    fn new(device: &Device, chain: Levels, degree: usize) -> Result<Self> {
        let (mut all, mut levels) = (Vec::new(), Vec::new());
        for level in 1..chain.count() {
            let gains = lobe_gains(chain.roughness(level), degree);
            levels.push([all.len() as u32, gains.len() as u32 - 1]);
            all.extend(gains.into_iter().map(|g| g as f32));
        }
        // a buffer has bytes even where there is nothing to do
        all.resize(all.len().max(1), 0.0);
        let buffer = storage(device, "veni gains", bytemuck::cast_slice(&all))?;
        Ok(Self { buffer, levels, glints: Mutex::default() })
    }
}
