//! Graphics devices, each opened once per process: Vulkan; on Windows DirectX 12 where there is no Vulkan, on macOS Metal.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use burn::tensor::wgpu::WgpuBackend;
use burn::tensor::wgpu::wgpu::DeviceType;
use burn::tensor::{Device, DeviceKind};

use super::WorkingDevice;
use crate::{Error, Result};

/// Graphics card `number`, from 0. Without one the adapter that wgpu prefers; `CUBECL_WGPU_DEFAULT_DEVICE` (e.g.
/// `IntegratedGpu(0)`) names another.
pub(super) fn open(number: Option<usize>) -> Result<WorkingDevice> {
    type Found = Result<WorkingDevice, String>;
    // burn opens an adapter once; a second request would be refused
    static OPENED: Mutex<BTreeMap<Option<usize>, Found>> = Mutex::new(BTreeMap::new());
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    let found = opened.entry(number).or_insert_with(|| {
        // elsewhere the choice would end at OpenGL, which nothing here was tried on
        let api =
            if cfg!(any(windows, target_os = "macos")) { WgpuBackend::Auto } else { WgpuBackend::Vulkan };
        let options = Device::wgpu_options().graphics_api(api);
        let options = match number {
            Some(number) => options.device_kind(DeviceKind::DiscreteGpu(number)),
            None => options,
        };
        let (device, setup) = options.init_with_setup().map_err(|error| error.to_string())?;
        let info = setup.adapter.get_info();
        Ok(WorkingDevice { device, name: info.name, software: info.device_type == DeviceType::Cpu })
    });
    found.clone().map_err(|cause| match number {
        Some(number) => Error::unsupported(format!(
            "device wgpu: there is no graphics card number {number}, counted from 0 ({cause}): \
             name one that there is, or none"
        )),
        None => Error::unsupported(format!(
            "device wgpu: there is no usable graphics adapter ({cause}): install a Vulkan driver (Mesa's, package \
             mesa-vulkan-drivers, also computes without a graphics card), or take device flex"
        )),
    })
}
