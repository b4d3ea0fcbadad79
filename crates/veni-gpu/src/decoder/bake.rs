//! Recording of a bake.

use wgpu::{
    BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer, BufferBinding, BufferSize, BufferUsages,
    CommandEncoder, ComputePassDescriptor, TextureView, TextureViewDescriptor, TextureViewDimension,
};

use super::target::Target;
use super::{Bake, GpuDecoder, GpuLatents};
use crate::buffers::{filled, storage};
use crate::error::{Error, Result};
use crate::scope::guarded;
use crate::shader::{Directions, Request, Store, Variant, pack_gains};

impl GpuDecoder {
    /// Records one compute pass that bakes all latents of `latents` into the target. Nothing is submitted; the host
    /// does that when it likes.
    ///
    /// Values beyond the range of the target's texels are clamped to it, never infinite: 65504 for `Rgba16Float`.
    /// Kernels are compiled at the first bake of each kind; see [`GpuDecoder::prepare`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if the target does not fit (format, usage, size, layers) or the latents are another model's;
    /// [`Error::Unsupported`] if a buffer is larger than the device binds; [`Error::Gpu`] if the device fails to make a
    /// resource. Nothing is recorded then.
    pub fn bake(&self, encoder: &mut CommandEncoder, latents: &GpuLatents, bake: &Bake<'_>) -> Result<()> {
        self.check_owner(latents)?;
        let (directions, store, request) = bake.request(latents.count)?;
        self.check_binding(&bake.target, latents.count)?;
        let variant = self.variant(directions, store);
        let pipeline = self.pipelines.get(&self.device, &variant)?;
        let dispatches = variant.dispatches(request, latents.count);
        let alignment = self.device.limits().min_uniform_buffer_offset_alignment;
        let stride = (Request::BYTES as u32).next_multiple_of(alignment);
        let requests = self.requests(&dispatches, stride)?;
        let view = self.view(&bake.target)?;
        let sixth = match &bake.target {
            Target::List { directions, .. } => (*directions).clone(),
            _ => self.gains(&request, latents)?,
        };
        let target = match (&bake.target, &view) {
            (_, Some(view)) => BindingResource::TextureView(view),
            (Target::Pixels { buffer, .. } | Target::List { buffer, .. }, _) => buffer.as_entire_binding(),
            (Target::Texture { .. }, None) => return Err(Error::invalid("a texture without a view")),
        };
        let request = BindingResource::Buffer(BufferBinding {
            buffer: &requests,
            offset: 0,
            size: BufferSize::new(Request::BYTES as u64),
        });
        let resources = [
            self.matrices.as_entire_binding(),
            self.vectors.as_entire_binding(),
            latents.buffer.as_entire_binding(),
            request,
            target,
            sixth.as_entire_binding(),
        ];
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| BindGroupEntry { binding, resource }).collect();
        let group = guarded(&self.device, "bindings of a bake", || {
            self.device.create_bind_group(&BindGroupDescriptor {
                label: Some("veni bake"),
                layout: &pipeline.layout,
                entries: &entries,
            })
        })?;
        let descriptor = ComputePassDescriptor { label: Some("veni bake"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&pipeline.pipeline);
        for (i, (_, [x, y, z])) in (0..).zip(&dispatches) {
            pass.set_bind_group(0, &group, &[i * stride]);
            pass.dispatch_workgroups(*x, *y, *z);
        }
        Ok(())
    }

    /// Compiles the kernel of a bake ahead of time, so that the first frame does not wait for it.
    ///
    /// # Errors
    /// As [`GpuDecoder::bake`].
    pub fn prepare(&self, latents: &GpuLatents, bake: &Bake<'_>) -> Result<()> {
        let (directions, store, _) = bake.request(latents.count)?;
        self.pipelines.get(&self.device, &self.variant(directions, store)).map(drop)
    }

    /// The kernel for these ends, as it runs here.
    pub fn variant(&self, directions: Directions, store: Store) -> Variant {
        Variant { sizes: self.sizes, kernel: self.kernel, weights: self.weights, directions, store }
    }

    /// The uniforms of all dispatches in one buffer.
    fn requests(&self, dispatches: &[(Request, [u32; 3])], stride: u32) -> Result<Buffer> {
        let mut bytes = Vec::with_capacity(dispatches.len() * stride as usize);
        for (request, _) in dispatches {
            bytes.extend(request.to_bytes());
            bytes.resize(bytes.len().next_multiple_of(stride as usize), 0);
        }
        filled(&self.device, "veni requests", BufferUsages::UNIFORM, &bytes)
    }

    /// What the lights add to the pixels of a grid.
    fn gains(&self, request: &Request, latents: &GpuLatents) -> Result<Buffer> {
        let gains = latents.with_lights(|lights| pack_gains(request, lights));
        match &gains[..] {
            // nothing: no buffer is made
            [_] => Ok(self.no_gains.clone()),
            _ => storage(&self.device, "veni lights on pixels", bytemuck::cast_slice(&gains)),
        }
    }

    fn view(&self, target: &Target<'_>) -> Result<Option<TextureView>> {
        let Target::Texture { texture, .. } = target else { return Ok(None) };
        let descriptor = TextureViewDescriptor {
            label: Some("veni bake"),
            dimension: Some(TextureViewDimension::D2Array),
            base_mip_level: 0,
            mip_level_count: Some(1),
            ..TextureViewDescriptor::default()
        };
        guarded(&self.device, "view of the target texture", || texture.create_view(&descriptor)).map(Some)
    }

    /// Buffers are bound whole: larger ones than the device binds are refused by name.
    fn check_binding(&self, target: &Target<'_>, latents: u32) -> Result<()> {
        let most = self.device.limits().max_storage_buffer_binding_size;
        let buffers: &[&Buffer] = match target {
            Target::Texture { .. } => &[],
            Target::Pixels { buffer, .. } => &[buffer],
            Target::List { directions, buffer, .. } => &[directions, buffer],
        };
        match buffers.iter().find(|buffer| buffer.size() > most) {
            None => Ok(()),
            Some(buffer) => Err(Error::unsupported(format!(
                "a buffer of {} bytes for {latents} latents: the device binds at most {most} \
                 (max_storage_buffer_binding_size); bake fewer rows or directions at a time",
                buffer.size()
            ))),
        }
    }
}
