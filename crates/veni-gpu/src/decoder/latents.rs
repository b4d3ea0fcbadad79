//! Latents on the device, conditioned.

use std::sync::{Arc, Mutex, PoisonError};

use veni_light::latent::Latent;
use veni_light::light::Lights;
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
    /// In units of radiance, one for each: what the host computes with areas needs them again.
    lights: Arc<Mutex<Vec<Lights>>>,
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

    /// Looks at the lights of all of them, as they are now.
    pub(crate) fn with_lights<T>(&self, look: impl FnOnce(&[Lights]) -> T) -> T {
        // a panic elsewhere leaves them as they were
        let all = self.lights.lock().unwrap_or_else(PoisonError::into_inner);
        look(&all[..self.count as usize])
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
    /// [`Error::Light`] if the latent does not fit the model, is not finite, or has more than 8 lights or 64 lobes; [`Error::Gpu`] if
    /// there is no memory.
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
        let (data, lights) = self.fold(latents)?;
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
        let lights = Arc::new(Mutex::new(lights));
        let latents = GpuLatents { buffer, count: count as u32, model: self.model.clone(), lights };
        self.write(queue, &latents, 0, &data)?;
        Ok(latents)
    }

    /// Replaces latents from the `first` on, in the same memory: for light that changes every frame. Takes effect for
    /// what is submitted after it; of their lights, what is recorded after it.
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
        let (data, lights) = self.fold(latents)?;
        let offset = 16 * self.sizes.latent_stride() as u64 * u64::from(first);
        self.write(queue, into, offset, &data)?;
        let mut all = into.lights.lock().unwrap_or_else(PoisonError::into_inner);
        all[first as usize..][..count].clone_from_slice(&lights);
        Ok(())
    }

    fn fold(&self, latents: &[Latent]) -> Result<(Vec<f32>, Vec<Lights>)> {
        let mut data = Vec::with_capacity(4 * self.sizes.latent_stride() * latents.len());
        let mut lights = Vec::with_capacity(latents.len());
        for latent in latents {
            let field = self.decoder.condition(latent)?;
            pack_latent(self.sizes, &field, &mut data)?;
            lights.push(field.lights().clone());
        }
        Ok((data, lights))
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
