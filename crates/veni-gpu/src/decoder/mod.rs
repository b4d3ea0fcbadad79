//! [`GpuDecoder`]: a model on the host's device.

mod bake;
mod latents;
mod pipelines;
mod target;

use std::fmt;

use veni_light::field::Decoder;
use veni_light::model::Model;
use wgpu::{Buffer, Device};

pub use latents::GpuLatents;
pub use target::Bake;
pub(crate) use target::{count, texture_grid};

use crate::buffers::storage;
use crate::error::{Error, Result};
use crate::shader::{Kernel, PackedModel, Sizes, WeightPrecision, pack_model};
use pipelines::Pipelines;

/// Which kernel runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KernelChoice {
    /// "Tiled", or "each" for decoders too wide to be tiled, with whatever of f16, subgroups and workgroup memory the
    /// device was opened with.
    #[default]
    Auto,
    /// The same with weights in f32 even where f16 would do: for a host whose own shaders read them so, as in a naga_oil
    /// module.
    SingleWeights,
    /// "Tiled" by WebGPU's default limits, without optional features.
    PlainTiled,
    /// "Each", without optional features.
    PlainEach,
}

/// A model's decoder on a device. Make one per model, keep it; all methods take `&self`.
pub struct GpuDecoder {
    device: Device,
    decoder: Decoder,
    sizes: Sizes,
    model: String,
    kernel: Kernel,
    weights: WeightPrecision,
    matrices: Buffer,
    vectors: Buffer,
    /// The list of a grid without lights.
    no_gains: Buffer,
    pipelines: Pipelines,
}

impl GpuDecoder {
    /// Uploads a model's weights (about a megabyte). Kernels are compiled at the first bake of each kind, or by
    /// [`GpuDecoder::prepare`].
    ///
    /// # Errors
    /// [`Error::Gpu`] if the device has not enough memory or is lost; [`Error::Unsupported`] if its limits are below what
    /// the weights need.
    pub fn new(device: &Device, model: &Model) -> Result<Self> {
        Self::with_kernel(device, model, KernelChoice::Auto)
    }

    /// The same with a kernel of one's choice.
    ///
    /// # Errors
    /// As [`GpuDecoder::new`], and [`Error::Unsupported`] if the decoder is too wide for the kernel.
    pub fn with_kernel(device: &Device, model: &Model, choice: KernelChoice) -> Result<Self> {
        let decoder = model.decoder()?;
        let packed = pack_model(model);
        let (kernel, half) = choose(device, &packed, choice)?;
        let weights = if half.is_some() { WeightPrecision::Half } else { WeightPrecision::Single };
        let bytes = match &half {
            Some(half) => bytemuck::cast_slice(half.as_slice()),
            None => bytemuck::cast_slice(packed.matrices.0.as_slice()),
        };
        Ok(Self {
            matrices: storage(device, "veni matrices", bytes)?,
            vectors: storage(device, "veni vectors", bytemuck::cast_slice(&packed.vectors))?,
            no_gains: storage(device, "veni lights on pixels", &[0; 16])?,
            pipelines: Pipelines::default(),
            device: device.clone(),
            decoder,
            sizes: packed.sizes,
            model: model.hash(),
            kernel,
            weights,
        })
    }

    /// The device it lives on.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// What its shaders are specialised on.
    pub fn sizes(&self) -> Sizes {
        self.sizes
    }

    /// The kernel that runs.
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Precision of [`GpuDecoder::matrices`].
    pub fn weights(&self) -> WeightPrecision {
        self.weights
    }

    /// `veni_matrices`, for a shader that includes [`field`](crate::shader::field).
    pub fn matrices(&self) -> &Buffer {
        &self.matrices
    }

    /// `veni_vectors`, for a shader that includes [`field`](crate::shader::field).
    pub fn vectors(&self) -> &Buffer {
        &self.vectors
    }
}

impl fmt::Debug for GpuDecoder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuDecoder")
            .field("model", &self.model)
            .field("sizes", &self.sizes)
            .field("kernel", &self.kernel)
            .field("weights", &self.weights)
            .finish_non_exhaustive()
    }
}

/// The kernel for a device, and the matrices in half precision if it uses them so.
fn choose(device: &Device, packed: &PackedModel, choice: KernelChoice) -> Result<(Kernel, Option<Vec<u16>>)> {
    let (info, features) = (device.adapter_info(), device.features());
    let groups = packed.sizes.columns() as u32 / 2;
    let memory = device.limits().max_compute_workgroup_storage_size;
    // a host may have opened its device with less
    let least = memory.min(wgpu::Limits::default().max_compute_workgroup_storage_size);
    let plain = Kernel::Tiled { memory: least, subgroups: false };
    let threads = Kernel::Tiled { memory, subgroups: false }.threads(packed.sizes);
    let subgroups = features.contains(wgpu::Features::SUBGROUP)
        && groups.is_power_of_two()
        && info.subgroup_min_size >= groups
        && threads.is_some_and(|n| n.is_multiple_of(info.subgroup_max_size));
    let kernel = match choice {
        KernelChoice::PlainEach => Kernel::Each,
        KernelChoice::PlainTiled if plain.threads(packed.sizes).is_none() => {
            let hidden = packed.sizes.hidden;
            return Err(Error::unsupported(format!(
                "a hidden size of {hidden} is too wide to be tiled in {least} bytes of workgroup memory; let the kernel \
                 be chosen"
            )));
        }
        KernelChoice::PlainTiled => plain,
        KernelChoice::Auto | KernelChoice::SingleWeights if threads.is_none() => Kernel::Each,
        KernelChoice::Auto | KernelChoice::SingleWeights => Kernel::Tiled { memory, subgroups },
    };
    let half = choice == KernelChoice::Auto && features.contains(wgpu::Features::SHADER_F16);
    Ok((kernel, if half { packed.matrices.to_half() } else { None }))
}
