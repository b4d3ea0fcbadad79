//! Where gradients are computed.

use serde::{Deserialize, Serialize};

use crate::Result;

/// What computes the decoder and its gradients in training: the same numbers up to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DecoderBy {
    /// The vectorised kernels of [`field`](crate::field), on the processor ([`Native`](crate::vae::Native)). A network
    /// that does not fold per latent is computed by tensor operations all the same.
    #[default]
    Kernels,
    /// Tensor operations on the device.
    Tensors,
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
}

impl DeviceKind {
    /// The device, without gradient tracking.
    ///
    /// # Errors
    /// [`Error::Unsupported`](crate::Error::Unsupported) if it is not compiled in.
    pub fn device(self) -> Result<burn::tensor::Device> {
        match self {
            Self::Flex => Ok(burn::tensor::Device::flex()),
            #[cfg(feature = "ndarray")]
            #[allow(deprecated, reason = "kept and tested while burn ships it")]
            Self::Ndarray => Ok(burn::tensor::Device::ndarray()),
            #[cfg(not(feature = "ndarray"))]
            Self::Ndarray => Err(crate::Error::unsupported(
                "device ndarray is not compiled in; build with --features ndarray",
            )),
        }
    }
}
