//! The host's renderer: maps uploaded once; per picture a pass from the sun into the shadow map, then a pass of surfaces and background
//! into floating point.

use veni_gpu::read_back;
use veni_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages, util::DeviceExt};

use super::Result;
use super::camera::{Camera, of_the_sun};
use super::mesh::{Look, Vertex, scene};
use super::sky::{Sky, Texels};

/// Texels along a side of the shadow map, and metres from its middle to its sides.
const SHADOW: (u32, f32) = (2048, 5.0);
const COLOUR: TextureFormat = TextureFormat::Rgba32Float;
const DEPTH: TextureFormat = TextureFormat::Depth32Float;

/// Pipelines, maps and meshes on the device.
pub(crate) struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    view: wgpu::Buffer,
    shadow_map: wgpu::TextureView,
    /// Each with its bindings.
    caster: (wgpu::RenderPipeline, wgpu::BindGroup),
    surface: (wgpu::RenderPipeline, wgpu::BindGroup),
    background: (wgpu::RenderPipeline, wgpu::BindGroup),
    meshes: [(Look, wgpu::Buffer, u32); 3],
    last_level: f32,
}

impl Renderer {
    pub(crate) fn new(device: wgpu::Device, queue: wgpu::Queue, sky: &Sky) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("lit scene"),
            source: wgpu::ShaderSource::Wgsl(include_str!("scene.wgsl").into()),
        });
        let caster = pipeline(&device, &module, "caster", None, wgpu::CompareFunction::Less);
        let surface = pipeline(&device, &module, "surface", Some("lit"), wgpu::CompareFunction::Less);
        let background =
            pipeline(&device, &module, "far_away", Some("background"), wgpu::CompareFunction::LessEqual);

        let view = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("view"),
            size: 4 * VIEW_FLOATS as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let specular = cube(&device, &queue, &sky.specular.iter().collect::<Vec<_>>());
        let diffuse = cube(&device, &queue, &[&sky.diffuse]);
        let flat = |size, rgb| upload(&device, &queue, size, 1, &[rgb], wgpu::TextureViewDimension::D2);
        let split_sum = flat([sky.dfg.size; 2], &sky.dfg.rgb[..]);
        let grid = sky.panorama.grid();
        let panorama = flat([grid.width as u32, grid.height as u32], sky.panorama.pixels());
        let sampler = |address_mode_u, compare| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                address_mode_u,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                compare,
                ..wgpu::SamplerDescriptor::default()
            })
        };
        let smooth = sampler(wgpu::AddressMode::ClampToEdge, None);
        let around = sampler(wgpu::AddressMode::Repeat, None);
        let compare = sampler(wgpu::AddressMode::ClampToEdge, Some(wgpu::CompareFunction::LessEqual));
        let usage = TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING;
        let shadow_map = target(&device, [SHADOW.0; 2], DEPTH, usage).create_view(&Default::default());

        let resources = [
            view.as_entire_binding(),
            wgpu::BindingResource::TextureView(&specular),
            wgpu::BindingResource::TextureView(&diffuse),
            wgpu::BindingResource::TextureView(&split_sum),
            wgpu::BindingResource::TextureView(&panorama),
            wgpu::BindingResource::Sampler(&smooth),
            wgpu::BindingResource::Sampler(&around),
            wgpu::BindingResource::TextureView(&shadow_map),
            wgpu::BindingResource::Sampler(&compare),
        ];
        // a pipeline's own layout has only what its stages use
        let bound = |pipeline: wgpu::RenderPipeline, used: &[u32]| {
            let entry = |&binding: &u32| wgpu::BindGroupEntry {
                binding,
                resource: resources[binding as usize].clone(),
            };
            let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("lit scene"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &used.iter().map(entry).collect::<Vec<_>>(),
            });
            (pipeline, group)
        };
        let caster = bound(caster, &[0]);
        let surface = bound(surface, &[0, 1, 2, 3, 5, 7, 8]);
        let background = bound(background, &[0, 4, 6]);

        let meshes = [Look::Picture, Look::Balls, Look::White].map(|look| {
            let triangles = scene(look);
            let buffer = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("triangles"),
                contents: bytemuck::cast_slice(triangles.as_flattened()),
                usage: BufferUsages::VERTEX,
            });
            (look, buffer, triangles.len() as u32)
        });
        let last_level = (sky.specular.len() - 1) as f32;
        Self { device, queue, view, shadow_map, caster, surface, background, meshes, last_level }
    }

    /// Radiance, row by row from the top. The sun is that of `sky`; its maps are those of `new`.
    pub(crate) fn render(
        &self,
        look: &Look,
        camera: &Camera,
        width: u32,
        height: u32,
        sky: &Sky,
    ) -> Result<Vec<[f32; 3]>> {
        self.queue.write_buffer(&self.view, 0, bytemuck::cast_slice(&self.view(camera, sky)));
        let usage = TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC;
        let picture = target(&self.device, [width, height], COLOUR, usage);
        let depth = target(&self.device, [width, height], DEPTH, TextureUsages::RENDER_ATTACHMENT);
        let (_, mesh, count) = self.meshes.iter().find(|(of, ..)| of == look).ok_or("no such mesh")?;

        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = pass(&mut encoder, None, &self.shadow_map);
            draw(&mut pass, &self.caster, Some(mesh), *count);
        }
        {
            let view = picture.create_view(&Default::default());
            let mut pass = pass(&mut encoder, Some(&view), &depth.create_view(&Default::default()));
            draw(&mut pass, &self.surface, Some(mesh), *count);
            draw(&mut pass, &self.background, None, 3);
        }
        self.queue.submit([encoder.finish()]);
        Ok(read_back::texture(&self.device, &self.queue, &picture)?)
    }

    /// The uniform `View` of `scene.wgsl`.
    fn view(&self, camera: &Camera, sky: &Sky) -> [f32; VIEW_FLOATS] {
        let four = |[x, y, z]: [f32; 3], w: f32| [x, y, z, w];
        // without a sun nothing shines from above
        let (direction, irradiance, radius) = sky
            .sun
            .map_or(([0.0, 1.0, 0.0], [0.0; 3], 0.01), |sun| (sun.direction, sun.irradiance, sun.radius));
        // the solid angle of the disc, 2π(1 − cos r), without cancellation
        let solid_angle = 4.0 * std::f32::consts::PI * (0.5 * radius).sin().powi(2);
        let mut words = Vec::new();
        words.extend_from_slice(camera.clip_from_world.as_flattened());
        words.extend_from_slice(of_the_sun(direction, SHADOW.1).as_flattened());
        words.extend([four(camera.eye, self.last_level), four(camera.forward, 0.0)].as_flattened());
        words.extend([four(camera.right, 0.0), four(camera.up, 0.0)].as_flattened());
        words.extend([four(direction, radius.cos()), four(irradiance, 1.0 / solid_angle)].as_flattened());
        std::array::from_fn(|k| words[k])
    }
}

const VIEW_FLOATS: usize = 56;

fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    vertex: &str,
    fragment: Option<&str>,
    depth_compare: wgpu::CompareFunction,
) -> wgpu::RenderPipeline {
    let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3];
    let layout = wgpu::VertexBufferLayout {
        array_stride: size_of::<Vertex>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &attributes,
    };
    // the background makes its triangle itself
    let buffers = [Some(layout)];
    let behind = depth_compare == wgpu::CompareFunction::LessEqual;
    let targets = [Some(COLOUR.into())];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(vertex),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers: if behind { &[] } else { &buffers },
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(!behind),
            depth_compare: Some(depth_compare),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: fragment.map(|entry| wgpu::FragmentState {
            module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    colour: Option<&wgpu::TextureView>,
    depth: &wgpu::TextureView,
) -> wgpu::RenderPass<'a> {
    let colour = colour.map(|view| wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations::default(),
    });
    let attachments = [colour];
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("lit scene"),
        color_attachments: if attachments[0].is_some() { &attachments } else { &[] },
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: depth,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Store }),
            stencil_ops: None,
        }),
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    })
}

fn draw(
    pass: &mut wgpu::RenderPass<'_>,
    (pipeline, group): &(wgpu::RenderPipeline, wgpu::BindGroup),
    mesh: Option<&wgpu::Buffer>,
    count: u32,
) {
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    if let Some(mesh) = mesh {
        pass.set_vertex_buffer(0, mesh.slice(..));
    }
    pass.draw(0..count, 0..1);
}

fn target(
    device: &wgpu::Device,
    [width, height]: [u32; 2],
    format: TextureFormat,
    usage: TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// A cube of these levels.
fn cube(device: &wgpu::Device, queue: &wgpu::Queue, levels: &[&Texels]) -> wgpu::TextureView {
    let rgb: Vec<&[[f32; 3]]> = levels.iter().map(|level| &level.rgb[..]).collect();
    upload(device, queue, [levels[0].size; 2], 6, &rgb, wgpu::TextureViewDimension::Cube)
}

/// Half floats, which every device filters: level after level, in each layer after layer.
fn upload(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    [width, height]: [u32; 2],
    layers: u32,
    levels: &[&[[f32; 3]]],
    dimension: wgpu::TextureViewDimension,
) -> wgpu::TextureView {
    let texels = levels.iter().flat_map(|level| level.iter());
    let halves: Vec<[half::f16; 4]> =
        texels.map(|&[r, g, b]| [r, g, b, 1.0].map(|v| half::f16::from_f32(v.min(65504.0)))).collect();
    let descriptor = wgpu::TextureDescriptor {
        label: Some("sky"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Rgba16Float,
        usage: TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    };
    let bytes: Vec<u8> = halves.as_flattened().iter().flat_map(|v| v.to_bits().to_ne_bytes()).collect();
    let order = wgpu::util::TextureDataOrder::MipMajor;
    let texture = device.create_texture_with_data(queue, &descriptor, order, &bytes);
    texture.create_view(&wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() })
}
