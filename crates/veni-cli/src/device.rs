//! What decodes: the CPU or a graphics device, chosen by `--device`, and baking on either.

mod cpu;
mod directions;
#[cfg(feature = "gpu")]
pub(crate) mod gpu;
mod on_cube;

use anyhow::Result;
use veni_light::field::{Decoder, Field};
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

use crate::args::DecodeDevice;
use crate::output::Push;
use crate::report::Report;

pub(crate) use directions::Directions;

/// What the CPU is called in results.
pub(crate) const CPU: &str = "CPU";

/// Why nothing of graphics devices works in this build, and what to do.
#[cfg(not(feature = "gpu"))]
pub(crate) const NO_GPU: &str = "this build cannot use graphics devices, since it lacks the feature `gpu`: build it \
    with 'cargo build --release -p veni-cli --features gpu'";

/// A model, ready on the device that decodes.
pub(crate) enum Device {
    Cpu(Decoder),
    #[cfg(feature = "gpu")]
    Gpu(gpu::Gpu),
}

/// A latent, ready to be baked on its device.
pub(crate) enum Baker {
    Cpu(Field),
    #[cfg(feature = "gpu")]
    Gpu(gpu::Conditioned),
}

impl Device {
    /// Readies a model on the device that was asked for.
    ///
    /// `auto` never fails, and never takes a software adapter: the CPU's own kernels are faster. `gpu` takes the first
    /// adapter of any kind, and fails if there is none.
    #[cfg(feature = "gpu")]
    pub(crate) fn open(choice: DecodeDevice, model: &Model, report: Report) -> Result<Self> {
        let gpu = gpu::open(choice, model, report)?;
        match gpu {
            Some(gpu) => Ok(Self::Gpu(gpu)),
            None => Ok(Self::Cpu(model.decoder()?)),
        }
    }

    /// The same in a build that knows the CPU only.
    #[cfg(not(feature = "gpu"))]
    pub(crate) fn open(choice: DecodeDevice, model: &Model, _: Report) -> Result<Self> {
        match choice {
            DecodeDevice::Auto | DecodeDevice::Cpu => Ok(Self::Cpu(model.decoder()?)),
            DecodeDevice::Gpu => anyhow::bail!("--device gpu: {NO_GPU}, or use --device cpu"),
        }
    }

    /// What to call it in results.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Cpu(_) => CPU,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.name(),
        }
    }

    /// Folds a latent.
    pub(crate) fn condition(&self, latent: &Latent) -> Result<Baker> {
        Ok(match self {
            Self::Cpu(decoder) => Baker::Cpu(decoder.condition(latent)?),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => Baker::Gpu(gpu.condition(latent)?),
        })
    }
}

impl Baker {
    /// The rows of an image from the top, a few in memory at a time.
    pub(crate) fn rows(&self, directions: Directions, each: Push<'_>) -> veni_light::Result<()> {
        match self {
            Self::Cpu(field) => cpu::rows(field, directions, each),
            #[cfg(feature = "gpu")]
            Self::Gpu(conditioned) => conditioned.rows(directions, each),
        }
    }

    /// A whole panorama, row-major from the top.
    pub(crate) fn bake(&self, grid: Equirect) -> veni_light::Result<Vec<[f32; 3]>> {
        let mut pixels = Vec::with_capacity(grid.len());
        self.rows(Directions::Equirect(grid), &mut |row| {
            pixels.extend_from_slice(row);
            Ok(())
        })?;
        Ok(pixels)
    }
}
