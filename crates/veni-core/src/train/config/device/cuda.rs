//! CUDA devices. The driver is loaded at run time; asking for devices without one finds none.

use burn::tensor::{Device, DeviceType};

use super::WorkingDevice;
use crate::{Error, Result};

/// Device `number`, from 0.
pub(super) fn open(number: usize) -> Result<WorkingDevice> {
    let found: Vec<_> = Device::enumerate(DeviceType::Cuda).into_iter().collect();
    let device = found.get(number).cloned().ok_or_else(|| match found.len() {
        0 => Error::unsupported(
            "device cuda: no CUDA device or driver: install NVIDIA's driver (nvidia-smi must list a card, and \
             CUDA_VISIBLE_DEVICES must not hide it), or take device wgpu or flex",
        ),
        count => Error::unsupported(format!(
            "device cuda: there is no number {number}: nvidia-smi -L lists {count}, counted from 0 \
             (CUDA_VISIBLE_DEVICES hides others); name those"
        )),
    })?;
    let name = device.identity().map_or_else(|| format!("CUDA device {number}"), |identity| identity.name);
    Ok(WorkingDevice { device, name, software: false })
}
