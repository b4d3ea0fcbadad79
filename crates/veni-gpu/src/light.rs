//! [`GpuLight`]: a light on the host's device, for shaders that include [`shader::light`](crate::shader::light).
//!
//! ```no_run
//! use veni_gpu::GpuLight;
//! use veni_gpu::shader::{self, LightDensity, pack_light};
//! use veni_gpu::wgpu::{Device, Queue};
//! use veni_light::light::Light;
//!
//! /// Once: the text that stands in front of the host's own, and the buffers that it binds in group 1.
//! fn load(device: &Device, light: &Light) -> Result<(String, GpuLight), Box<dyn std::error::Error>> {
//!     // compensated: half of the samples are drawn by the surface, and the balance heuristic weighs them
//!     let packed = pack_light(light, LightDensity::Compensated)?;
//!     Ok((shader::light_bindings(1, 0) + &shader::light(), GpuLight::new(device, &packed)?))
//! }
//!
//! /// Per frame: the sky rotates.
//! fn frame(light: &GpuLight, queue: &Queue, radians: f64) -> veni_gpu::Result<()> {
//!     light.rotate(queue, radians)
//! }
//! ```

use wgpu::{Buffer, BufferUsages, Device, Queue};

use crate::buffers::{filled, storage};
use crate::error::{Error, Result};
use crate::scope::guarded;
use crate::shader::{LightUniform, PackedLight};

/// A packed light on a device: the three buffers of [`light_bindings`](crate::shader::light_bindings), uploaded once.
#[derive(Clone, Debug)]
pub struct GpuLight {
    device: Device,
    uniform: Buffer,
    cells: Buffer,
    texels: Buffer,
}

impl GpuLight {
    /// Uploads a light: 16 bytes per pixel, and 8 per cell of the alias table.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if it is larger than the device binds; [`Error::Gpu`] if there is no memory.
    pub fn new(device: &Device, packed: &PackedLight) -> Result<Self> {
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        Ok(Self {
            device: device.clone(),
            uniform: filled(device, "veni light", usage, &packed.uniform.to_bytes())?,
            cells: storage(device, "veni light cells", bytemuck::cast_slice(&packed.cells))?,
            texels: storage(device, "veni light texels", bytemuck::cast_slice(&packed.texels))?,
        })
    }

    /// Rotates the scene to `radians` about z, counter-clockwise seen from above, from where it was packed: eight
    /// bytes. Takes effect for what is submitted after it.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the angle is not finite; [`Error::Gpu`] if the device fails.
    pub fn rotate(&self, queue: &Queue, radians: f64) -> Result<()> {
        if !radians.is_finite() {
            return Err(Error::invalid(format!("a rotation by {radians} radians: it must be finite")));
        }
        guarded(&self.device, "rotation of a light", || {
            queue.write_buffer(&self.uniform, 0, &LightUniform::rotation_bytes(radians));
        })
    }

    /// `veni_light`.
    pub fn uniform(&self) -> &Buffer {
        &self.uniform
    }

    /// `veni_light_cells`.
    pub fn cells(&self) -> &Buffer {
        &self.cells
    }

    /// `veni_light_texels`.
    pub fn texels(&self) -> &Buffer {
        &self.texels
    }
}
