//! Where gradients are computed.
//!
//! | kind | feature | what computes |
//! |---|---|---|
//! | `flex` | | all cores of the processor |
//! | `ndarray` | `ndarray` | all cores of the processor, through ndarray |
//! | `wgpu` | `wgpu` | a graphics device by Vulkan, Metal or DirectX 12, on what wgpu takes for the fastest |
//! | `cuda` | `cuda` | the first CUDA device (`CUDA_VISIBLE_DEVICES` orders them) |
//!
//! A device that is not there is an error with its remedy: nothing falls back to another.

#[cfg(feature = "cuda")]
mod cuda;
mod numbers;
#[cfg(test)]
mod tests;
#[cfg(feature = "wgpu")]
mod wgpu;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

pub use numbers::Devices;

use crate::Result;

/// The decoder backend, which computes the decoder and its gradients in training: the same numbers up to rounding, which
/// [`DecoderBackend::KernelsBfloat16`] does more coarsely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DecoderBackend {
    /// The vectorised kernels of [`field`](veni_light::field), on the processor ([`Native`](crate::vae::Native)) whatever
    /// the device. A network that does not fold per latent is computed by tensor operations all the same.
    #[default]
    Kernels,
    /// Tensor operations on the device.
    Tensors,
    /// The kernels with mixed precision: factors of the matrix products rounded to bfloat16 (eight significant bits),
    /// sums and all else in f32. Only processors with AVX512-BF16 have it.
    KernelsBfloat16,
}

impl DecoderBackend {
    /// Whether this machine computes so.
    ///
    /// # Errors
    /// [`Error::Unsupported`](crate::Error::Unsupported) where products in bfloat16 are wanted and the processor has
    /// none.
    pub fn check(self) -> Result<()> {
        if self == Self::KernelsBfloat16 { crate::vae::Native::check_bfloat16() } else { Ok(()) }
    }

    /// Whether it is one of the two that compute by kernels, on the processor.
    pub fn is_kernels(self) -> bool {
        self != Self::Tensors
    }
}

/// Where gradients are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceKind {
    /// burn's flex CPU backend.
    #[default]
    Flex,
    /// burn's ndarray CPU backend (feature `ndarray`).
    Ndarray,
    /// burn's wgpu backend (feature `wgpu`).
    Wgpu,
    /// burn's CUDA backend (feature `cuda`).
    Cuda,
}

/// A device that was found to work.
#[derive(Clone, Debug)]
pub struct WorkingDevice {
    /// Without gradient tracking.
    pub device: Device,
    /// The adapter's own name; of a processor burn's name of the backend.
    pub name: String,
    /// Whether it is a graphics device that the processor imitates, such as Mesa's lavapipe.
    pub software: bool,
}

impl DeviceKind {
    /// The fastest of this build and machine: CUDA, then a graphics card, then flex. A graphics device that the
    /// processor imitates is slower than the processor itself, and not taken.
    pub fn fastest() -> Self {
        let real = |kind: Self| kind.open().is_ok_and(|opened| !opened.software);
        [Self::Cuda, Self::Wgpu].into_iter().find(|kind| real(*kind)).unwrap_or(Self::Flex)
    }

    /// The best decoder backend here: kernels on a processor, tensor operations on any other device, whose data
    /// would have to come to the processor and back.
    pub fn decoder_backend(self) -> DecoderBackend {
        if self.is_processor() { DecoderBackend::Kernels } else { DecoderBackend::Tensors }
    }

    /// Whether it is the processor, through one of burn's backends for it.
    pub fn is_processor(self) -> bool {
        match self {
            Self::Flex | Self::Ndarray => true,
            Self::Wgpu | Self::Cuda => false,
        }
    }

    /// The device, without gradient tracking.
    ///
    /// # Errors
    /// As [`DeviceKind::open`].
    pub fn device(self) -> Result<Device> {
        self.open().map(|opened| opened.device)
    }

    /// The device and what it is: the first of its kind.
    ///
    /// # Errors
    /// [`Error::Unsupported`](crate::Error::Unsupported) if it is not compiled in, or this machine has none.
    pub fn open(self) -> Result<WorkingDevice> {
        self.open_number(None)
    }

    /// The devices of these numbers, at least one. CUDA counts as `nvidia-smi -L` does, within `CUDA_VISIBLE_DEVICES`; wgpu
    /// counts graphics cards, and 0 alone is whatever it prefers. A processor has as many as are asked for: shares of its
    /// threads.
    ///
    /// # Errors
    /// As [`DeviceKind::open`], naming the number.
    pub fn open_all(self, devices: &Devices) -> Result<Vec<WorkingDevice>> {
        if *devices == Devices::default() {
            return Ok(vec![self.open()?]);
        }
        devices.numbers().iter().map(|number| self.open_number(Some(*number))).collect()
    }

    #[cfg_attr(
        not(any(feature = "wgpu", feature = "cuda")),
        allow(unused_variables, reason = "processors have no numbers")
    )]
    fn open_number(self, number: Option<usize>) -> Result<WorkingDevice> {
        match self {
            Self::Flex => Ok(processor(Device::flex(), "flex")),
            #[cfg(feature = "ndarray")]
            #[allow(deprecated, reason = "kept and tested while burn ships it")]
            Self::Ndarray => Ok(processor(Device::ndarray(), "ndarray")),
            #[cfg(not(feature = "ndarray"))]
            Self::Ndarray => Err(not_compiled_in("ndarray")),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => wgpu::open(number),
            #[cfg(not(feature = "wgpu"))]
            Self::Wgpu => Err(not_compiled_in("wgpu")),
            #[cfg(feature = "cuda")]
            Self::Cuda => cuda::open(number.unwrap_or(0)),
            #[cfg(not(feature = "cuda"))]
            Self::Cuda => Err(not_compiled_in("cuda")),
        }
    }
}

fn processor(device: Device, name: &str) -> WorkingDevice {
    WorkingDevice { device, name: name.into(), software: false }
}

#[cfg(not(all(feature = "ndarray", feature = "wgpu", feature = "cuda")))]
fn not_compiled_in(name: &str) -> crate::Error {
    crate::Error::unsupported(format!(
        "device {name} is not compiled in: build with the feature {name}, or take device flex"
    ))
}
