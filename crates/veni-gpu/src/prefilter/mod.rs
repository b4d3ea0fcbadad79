//! [`GpuPrefilter`]: harmonics and prefiltered cube maps of latents, without leaving the device.
//!
//! A latent's radiance on rings of latitude gives its spherical harmonics (LIGHT (19)); harmonics times one number per degree,
//! summed in every direction, give a level (LIGHT (20)). Lights are too narrow for that: their harmonics are in closed form, and levels
//! get what the lobe makes of them (LIGHT (21)). Nothing is sampled at random, so nothing is noisy from frame to frame.
//!
//! ```no_run
//! use veni_gpu::wgpu::{CommandEncoder, Texture};
//! use veni_gpu::{GpuDecoder, GpuHarmonics, GpuLatents, GpuPrefilter, PrefilteredCube, Result};
//! use veni_light::light::Law;
//! use veni_light::sphere::Frame;
//!
//! /// Per frame. `cube` has six layers and a mip chain; `GpuPrefilter::new`, `harmonics(1)` and `GpuDecoder::condition` came before.
//! fn record(
//!     (decoder, prefilter): (&GpuDecoder, &GpuPrefilter),
//!     encoder: &mut CommandEncoder,
//!     (latents, harmonics): (&GpuLatents, &GpuHarmonics),
//!     cube: &Texture,
//! ) -> Result<()> {
//!     prefilter.analyse(encoder, decoder, latents, harmonics)?;
//!     let cube = PrefilteredCube::new(cube, Law::Linear).frame(Frame::Bevy);
//!     prefilter.bake(encoder, decoder, latents, harmonics, &cube)
//! }
//! ```

mod analysis;
mod cube;
mod layout;
mod levels;

use wgpu::{BindGroupLayout, Buffer, BufferUsages, ComputePipeline, Device};

pub use analysis::GpuHarmonics;
pub use cube::PrefilteredCube;

use crate::buffers::{filled, storage};
use crate::error::{Error, Result};
use crate::scope::guarded;
use crate::shader::{MAX_DEGREE, SPECTRUM_ENTRY_POINTS, SpectrumTables, spectrum_source};
use layout::{Access, layout, module, pipeline};
use levels::Chains;

/// What turns latents into harmonics and levels, for a largest degree. Make one, keep it; all methods take `&self`, and what
/// [`GpuPrefilter::analyse`] and [`GpuPrefilter::bake`] record, the host submits.
#[derive(Debug)]
pub struct GpuPrefilter {
    device: Device,
    tables: Tables,
    layout: BindGroupLayout,
    passes: [ComputePipeline; 2],
    chains: Chains,
    /// What stands for the lights of latents without.
    no_lights: Buffer,
}

/// [`SpectrumTables`] on the device.
#[derive(Debug)]
struct Tables {
    degree: usize,
    /// Directions on the rings.
    count: u32,
    /// Workgroups of both passes.
    groups: [u32; 2],
    /// vec4f of waves and coefficients of a latent.
    sizes: [u64; 2],
    uniform: Buffer,
    directions: Buffer,
    phases: Buffer,
    legendre: Buffer,
    steps: Buffer,
}

impl GpuPrefilter {
    /// The usual largest degree: what a decoded field holds beyond it is measured in docs/LIGHT.md.
    pub const DEGREE: usize = 64;

    /// For harmonics up to [`GpuPrefilter::DEGREE`].
    ///
    /// # Errors
    /// [`Error::Gpu`] if the device has not enough memory or is lost.
    pub fn new(device: &Device) -> Result<Self> {
        Self::with_degree(device, Self::DEGREE)
    }

    /// For harmonics up to `degree`, from 2 to 128. Degree 2 is enough for irradiance; the field is then asked for
    /// 8,192 directions instead of 33,800.
    ///
    /// # Errors
    /// As [`GpuPrefilter::new`], and [`Error::Invalid`] for another degree.
    pub fn with_degree(device: &Device, degree: usize) -> Result<Self> {
        if !(2..=MAX_DEGREE).contains(&degree) {
            return Err(Error::invalid(format!(
                "harmonics up to degree {degree}: the largest degree is from 2 to {MAX_DEGREE}"
            )));
        }
        let tables = SpectrumTables::new(degree);
        let (uniform, read, write) =
            (Access::Uniform { bytes: 16, dynamic: false }, Access::Read, Access::Write);
        let accesses = [uniform, read, read, read, write, write, read, write];
        let layout = guarded(device, "veni harmonics", || layout(device, &accesses))?;
        let module = guarded(device, "veni harmonics", || module(device, spectrum_source()))?;
        let [waves, degrees] = SPECTRUM_ENTRY_POINTS
            .map(|entry| guarded(device, "veni harmonics", || pipeline(device, &layout, &module, entry)));
        Ok(Self {
            device: device.clone(),
            tables: Tables::new(device, &tables)?,
            layout,
            passes: [waves?, degrees?],
            chains: Chains::default(),
            no_lights: storage(device, "veni harmonics of lights", &[0; 16])?,
        })
    }

    /// L.
    pub fn degree(&self) -> usize {
        self.tables.degree
    }
}

impl Tables {
    fn new(device: &Device, tables: &SpectrumTables) -> Result<Self> {
        let orders = tables.degree + 1;
        let groups = [orders * tables.rings, tables.coefficients()].map(|n| n.div_ceil(64) as u32);
        let buffer = |label, bytes| storage(device, label, bytes);
        Ok(Self {
            degree: tables.degree,
            count: tables.directions.len() as u32,
            groups,
            sizes: [tables.waves(), tables.coefficients()].map(|n| n as u64),
            uniform: filled(device, "veni rings", BufferUsages::UNIFORM, &tables.to_bytes())?,
            directions: buffer("veni ring directions", bytemuck::cast_slice(&tables.directions))?,
            phases: buffer("veni ring phases", bytemuck::cast_slice(&tables.phases))?,
            legendre: buffer("veni Legendre functions", bytemuck::cast_slice(&tables.legendre))?,
            steps: buffer("veni Legendre steps", bytemuck::cast_slice(&tables.steps))?,
        })
    }
}
