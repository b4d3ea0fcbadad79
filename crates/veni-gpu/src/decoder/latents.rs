//! Latents on the device, conditioned.

use veni_light::latent::Latent;
use wgpu::{Buffer, BufferDescriptor, BufferUsages, Queue};

use super::GpuDecoder;
use crate::error::{Error, Result};
use crate::scope::guarded;
use crate::shader::pack_latent;

/// Most latents of a batch: WebGPU's limit on the third dimension of a dispatch.
const MAX_BATCH: usize = 65_535;

/// One or more latents, conditioned by a decoder and resident on its device. Any number may be alive at once.
#[derive(Clone, Debug)]
pub struct GpuLatents {
    pub(super) buffer: Buffer,
    pub(super) count: u32,
    pub(super) model: String,
}

impl GpuLatents {
    /// How many.
    pub fn len(&self) -> u32 {
        self.count
    }

    /// Never true; here because `len` is.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The first of them alone, in the same memory.
    pub(crate) fn first(&self) -> Self {
        Self { count: 1, ..self.clone() }
    }

    /// `veni_latents`, for a shader that includes [`field`](crate::shader::field).
    pub fn buffer(&self) -> &Buffer {
        &self.buffer
    }
}

impl GpuDecoder {
    /// Folds a latent on the CPU (microseconds) and uploads it: a few kilobytes.
    ///
    /// # Errors
    /// [`Error::Light`] if the latent does not fit the model, is not finite, or has lights or lobes, which the shaders do not draw;
    /// [`Error::Gpu`] if there is no memory.
    pub fn condition(&self, queue: &Queue, latent: &Latent) -> Result<GpuLatents> {
        self.condition_batch(queue, std::slice::from_ref(latent))
    }

    /// Several latents, baked by one call: the frames of an animation, for instance.
    ///
    /// # Errors
    /// As [`GpuDecoder::condition`]; [`Error::Invalid`] for none or more than 65535; [`Error::Unsupported`] if they are more
    /// than the device binds at once.
    pub fn condition_batch(&self, queue: &Queue, latents: &[Latent]) -> Result<GpuLatents> {
        let count = latents.len();
        if count == 0 || count > MAX_BATCH {
            return Err(Error::invalid(format!(
                "a batch of {count} latents: it must have from 1 to {MAX_BATCH}"
            )));
        }
        let data = self.fold(latents)?;
        let size = 4 * data.len() as u64;
        let most = self.device.limits().max_storage_buffer_binding_size;
        if size > most {
            return Err(Error::unsupported(format!(
                "{count} latents take {size} bytes, the device binds at most {most} \
                 (max_storage_buffer_binding_size); make smaller batches"
            )));
        }
        let descriptor = BufferDescriptor {
            label: Some("veni latents"),
            size,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        };
        let buffer = guarded(&self.device, "veni latents", || self.device.create_buffer(&descriptor))?;
        let latents = GpuLatents { buffer, count: count as u32, model: self.model.clone() };
        self.write(queue, &latents, 0, &data)?;
        Ok(latents)
    }

    /// Replaces latents from the `first` on, in the same memory: for light that changes every frame. Takes effect for
    /// what is submitted after it.
    ///
    /// # Errors
    /// [`Error::Light`] as for [`GpuDecoder::condition`]; [`Error::Invalid`] if the batch does not hold them or is
    /// another model's; [`Error::Gpu`] if the device fails.
    pub fn update(&self, queue: &Queue, into: &GpuLatents, first: u32, latents: &[Latent]) -> Result<()> {
        self.check_owner(into)?;
        let (count, free) = (latents.len(), into.count.saturating_sub(first) as usize);
        if count > free {
            return Err(Error::invalid(format!(
                "{count} latents from the {first}th on do not fit in a batch of {}",
                into.count
            )));
        }
        let data = self.fold(latents)?;
        let offset = 16 * self.sizes.latent_stride() as u64 * u64::from(first);
        self.write(queue, into, offset, &data)
    }

    fn fold(&self, latents: &[Latent]) -> Result<Vec<f32>> {
        let mut data = Vec::with_capacity(4 * self.sizes.latent_stride() * latents.len());
        for latent in latents {
            pack_latent(self.sizes, &self.decoder.condition(latent)?, &mut data)?;
        }
        Ok(data)
    }

    fn write(&self, queue: &Queue, into: &GpuLatents, offset: u64, data: &[f32]) -> Result<()> {
        guarded(&self.device, "upload of latents", || {
            queue.write_buffer(&into.buffer, offset, bytemuck::cast_slice(data));
        })
    }

    pub(super) fn check_owner(&self, latents: &GpuLatents) -> Result<()> {
        if latents.model == self.model {
            return Ok(());
        }
        Err(Error::invalid(format!(
            "these latents were conditioned by model {}, this is {}",
            latents.model, self.model
        )))
    }
}
