//! Compiled kernels, made when first needed.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{
    BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType, BufferBindingType,
    BufferSize, ComputePipeline, ComputePipelineDescriptor, Device, PipelineCompilationOptions,
    PipelineLayoutDescriptor, ShaderModuleDescriptor, ShaderSource, ShaderStages, StorageTextureAccess,
    TextureFormat, TextureViewDimension,
};

use crate::error::Result;
use crate::scope::guarded;
use crate::shader::{Binding, Directions, ENTRY_POINT, Request, StorageFormat, Store, Variant};

/// A kernel and the layout of its group 0.
#[derive(Debug)]
pub(super) struct Pipeline {
    pub(super) pipeline: ComputePipeline,
    pub(super) layout: BindGroupLayout,
}

/// Kernels by their ends; everything else of a variant is the decoder's.
#[derive(Debug, Default)]
pub(super) struct Pipelines(Mutex<HashMap<(Directions, Store), Arc<Pipeline>>>);

impl Pipelines {
    pub(super) fn get(&self, device: &Device, variant: &Variant) -> Result<Arc<Pipeline>> {
        // a panic elsewhere leaves the map as it was
        let mut map = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (variant.directions, variant.store);
        if let Some(pipeline) = map.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        let pipeline = Arc::new(guarded(device, "veni kernel", || compile(device, variant))?);
        map.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }
}

fn compile(device: &Device, variant: &Variant) -> Pipeline {
    let module = device.create_shader_module(ShaderModuleDescriptor {
        label: Some("veni bake"),
        source: ShaderSource::Wgsl(variant.source().into()),
    });
    let entries: Vec<_> = (0..).zip(variant.bindings()).map(|(i, binding)| entry(i, binding)).collect();
    let layout = device
        .create_bind_group_layout(&BindGroupLayoutDescriptor { label: Some("veni bake"), entries: &entries });
    let pipeline_layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("veni bake"),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&ComputePipelineDescriptor {
        label: Some("veni bake"),
        layout: Some(&pipeline_layout),
        module: &module,
        entry_point: Some(ENTRY_POINT),
        compilation_options: PipelineCompilationOptions {
            constants: &variant.constants(),
            // every kernel writes its workgroup memory before it reads it
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    });
    Pipeline { pipeline, layout }
}

fn entry(binding: u32, what: Binding) -> BindGroupLayoutEntry {
    let buffer = |ty: BufferBindingType, has_dynamic_offset: bool, min: Option<BufferSize>| {
        BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: min }
    };
    let ty = match what {
        Binding::Read => buffer(BufferBindingType::Storage { read_only: true }, false, None),
        Binding::Write => buffer(BufferBindingType::Storage { read_only: false }, false, None),
        Binding::Uniform => buffer(BufferBindingType::Uniform, true, BufferSize::new(Request::BYTES as u64)),
        Binding::Texture(format) => BindingType::StorageTexture {
            access: StorageTextureAccess::WriteOnly,
            format: texture_format(format),
            view_dimension: TextureViewDimension::D2Array,
        },
    };
    BindGroupLayoutEntry { binding, visibility: ShaderStages::COMPUTE, ty, count: None }
}

fn texture_format(format: StorageFormat) -> TextureFormat {
    match format {
        StorageFormat::Rgba32Float => TextureFormat::Rgba32Float,
        StorageFormat::Rgba16Float => TextureFormat::Rgba16Float,
    }
}
