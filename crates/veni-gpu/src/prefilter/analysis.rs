//! From latents to harmonics.

use wgpu::{Buffer, BufferDescriptor, BufferUsages, CommandEncoder, ComputePassDescriptor};

use super::layout::group;
use super::{GpuPrefilter, Tables};
use crate::buffers::storage;
use crate::decoder::{Bake, GpuDecoder, GpuLatents};
use crate::error::{Error, Result};
use crate::scope::guarded;
use crate::shader::pack_light_harmonics;

/// Workspace on the device: the harmonics of one or more latents, and what finding them takes. Make it once, for every frame.
#[derive(Clone, Debug)]
pub struct GpuHarmonics {
    count: u32,
    degree: usize,
    radiance: Buffer,
    waves: Buffer,
    rest: Buffer,
    coefficients: Buffer,
}

impl GpuHarmonics {
    /// The number of latents it is for.
    pub fn len(&self) -> u32 {
        self.count
    }

    /// Never true; here because `len` is.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The coefficients, lights included: per latent (L + 1)² vec4f (R, G, B, 0), c_lm of radiance at l² + l + m, native, with the sign (−1)^m, as
    /// [`Sh::coefficients`](veni_light::light::Sh::coefficients). The first nine are those of most engines. Usage `STORAGE` and
    /// `COPY_SRC`.
    pub fn coefficients(&self) -> &Buffer {
        &self.coefficients
    }

    /// The same without the lights, for hosts that draw the sun as a light of its own.
    pub fn rest(&self) -> &Buffer {
        &self.rest
    }

    /// L.
    pub fn degree(&self) -> usize {
        self.degree
    }
}

impl GpuPrefilter {
    /// Room for the harmonics of `count` latents.
    ///
    /// # Errors
    /// [`Error::Invalid`] for none; [`Error::Unsupported`] if they are more than the device binds at once; [`Error::Gpu`] if there is
    /// no memory.
    pub fn harmonics(&self, count: u32) -> Result<GpuHarmonics> {
        if count == 0 {
            return Err(Error::invalid("harmonics of 0 latents: there must be some"));
        }
        let most = self.device.limits().max_storage_buffer_binding_size;
        let buffer = |label: &'static str, vectors: u64, usage: BufferUsages| {
            let size = 16 * vectors * u64::from(count);
            if size > most {
                return Err(Error::unsupported(format!(
                    "{label} of {count} latents take {size} bytes, the device binds at most {most} \
                     (max_storage_buffer_binding_size); take fewer at a time"
                )));
            }
            let descriptor = BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            guarded(&self.device, label, || self.device.create_buffer(&descriptor))
        };
        let [waves, coefficients] = self.tables.sizes;
        let usage = BufferUsages::STORAGE;
        Ok(GpuHarmonics {
            count,
            degree: self.tables.degree,
            radiance: buffer("veni ring radiance", u64::from(self.tables.count), usage)?,
            waves: buffer("veni waves", waves, usage)?,
            rest: buffer("veni harmonics of the rest", coefficients, usage | BufferUsages::COPY_SRC)?,
            coefficients: buffer("veni harmonics", coefficients, usage | BufferUsages::COPY_SRC)?,
        })
    }

    /// Records what fills `into` with the harmonics of `latents`: their radiance on rings, and two passes of sums; those of their
    /// lights are added in closed form. Nothing is submitted.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the workspace is of fewer latents or another degree, or the latents are another model's;
    /// [`Error::Gpu`] if the device fails to make a resource. Nothing is recorded then.
    pub fn analyse(
        &self,
        encoder: &mut CommandEncoder,
        decoder: &GpuDecoder,
        latents: &GpuLatents,
        into: &GpuHarmonics,
    ) -> Result<()> {
        self.check(latents, into)?;
        let Tables { uniform, phases, legendre, directions, count, groups, .. } = &self.tables;
        let lights = self.light_harmonics(latents)?;
        let GpuHarmonics { radiance, waves, rest, coefficients, .. } = into;
        let buffers = [uniform, phases, legendre, radiance, waves, rest, &lights, coefficients];
        let group = guarded(&self.device, "bindings of harmonics", || {
            let resources = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
            group(&self.device, &self.layout, resources)
        })?;
        decoder.bake(encoder, latents, &Bake::directions(directions, radiance, *count).without_lights())?;
        let descriptor = ComputePassDescriptor { label: Some("veni harmonics"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_bind_group(0, &group, &[]);
        for (pipeline, groups) in self.passes.iter().zip(groups) {
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(*groups, 1, latents.len());
        }
        Ok(())
    }

    fn light_harmonics(&self, latents: &GpuLatents) -> Result<Buffer> {
        let packed = latents.with_lights(|lights| pack_light_harmonics(self.degree(), lights));
        match &packed[..] {
            // no lights: no buffer is made
            [_] => Ok(self.no_lights.clone()),
            _ => storage(&self.device, "veni harmonics of lights", bytemuck::cast_slice(&packed)),
        }
    }

    pub(super) fn check(&self, latents: &GpuLatents, harmonics: &GpuHarmonics) -> Result<()> {
        if harmonics.degree != self.tables.degree {
            return Err(Error::invalid(format!(
                "harmonics up to degree {} where those up to {} are made",
                harmonics.degree, self.tables.degree
            )));
        }
        if latents.len() > harmonics.count {
            return Err(Error::invalid(format!(
                "{} latents where the workspace holds the harmonics of {}",
                latents.len(),
                harmonics.count
            )));
        }
        Ok(())
    }
}
