//! Layouts, modules and pipelines of the kernels here: group 0, bindings in order.

use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor,
    BindGroupLayoutEntry, BindingResource, BindingType, BufferBindingType, BufferSize, ComputePipeline,
    ComputePipelineDescriptor, Device, PipelineCompilationOptions, PipelineLayoutDescriptor, ShaderModule,
    ShaderModuleDescriptor, ShaderSource, ShaderStages, StorageTextureAccess, TextureFormat,
    TextureViewDimension,
};

/// What a binding holds.
#[derive(Clone, Copy, Debug)]
pub(super) enum Access {
    Uniform { bytes: u64, dynamic: bool },
    Read,
    Write,
    Texture(TextureFormat),
}

pub(super) fn layout(device: &Device, accesses: &[Access]) -> BindGroupLayout {
    let storage = |read_only| BindingType::Buffer {
        ty: BufferBindingType::Storage { read_only },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let entry = |(binding, access): (u32, &Access)| BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::COMPUTE,
        ty: match *access {
            Access::Uniform { bytes, dynamic } => BindingType::Buffer {
                ty: BufferBindingType::Uniform,
                has_dynamic_offset: dynamic,
                min_binding_size: BufferSize::new(bytes),
            },
            Access::Read => storage(true),
            Access::Write => storage(false),
            Access::Texture(format) => BindingType::StorageTexture {
                access: StorageTextureAccess::WriteOnly,
                format,
                view_dimension: TextureViewDimension::D2Array,
            },
        },
        count: None,
    };
    let entries: Vec<_> = (0..).zip(accesses).map(entry).collect();
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: Some("veni prefilter"),
        entries: &entries,
    })
}

pub(super) fn module(device: &Device, source: &str) -> ShaderModule {
    device.create_shader_module(ShaderModuleDescriptor {
        label: Some("veni prefilter"),
        source: ShaderSource::Wgsl(source.into()),
    })
}

pub(super) fn pipeline(
    device: &Device,
    layout: &BindGroupLayout,
    module: &ShaderModule,
    entry: &str,
) -> ComputePipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("veni prefilter"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_compute_pipeline(&ComputePipelineDescriptor {
        label: Some("veni prefilter"),
        layout: Some(&layout),
        module,
        entry_point: Some(entry),
        compilation_options: PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// A group of resources at bindings 0, 1, …
pub(super) fn group(
    device: &Device,
    layout: &BindGroupLayout,
    resources: Vec<BindingResource<'_>>,
) -> BindGroup {
    let entries: Vec<_> =
        (0..).zip(resources).map(|(binding, resource)| BindGroupEntry { binding, resource }).collect();
    device.create_bind_group(&BindGroupDescriptor {
        label: Some("veni prefilter"),
        layout,
        entries: &entries,
    })
}
