//! The CUDA device. The driver is loaded at run time; asking for devices without one finds none.

use burn::tensor::{Device, DeviceType};

use super::Opened;
use crate::{Error, Result};

pub(super) fn open() -> Result<Opened> {
    let found = Device::enumerate(DeviceType::Cuda).into_iter().next();
    let device = found.ok_or_else(|| {
        Error::unsupported(
            "device cuda: no CUDA device or driver: install NVIDIA's driver (nvidia-smi must list a card, and \
             CUDA_VISIBLE_DEVICES must not hide it), or take device wgpu or flex",
        )
    })?;
    let name = device.identity().map_or_else(|| "CUDA device 0".into(), |identity| identity.name);
    Ok(Opened { device, name, software: false })
}
