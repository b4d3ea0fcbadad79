//! The graphics device, opened once per process: Vulkan; on Windows DirectX 12 where there is no Vulkan, on macOS Metal.

use std::sync::OnceLock;

use burn::tensor::Device;
use burn::tensor::wgpu::WgpuBackend;
use burn::tensor::wgpu::wgpu::DeviceType;

use super::Opened;
use crate::{Error, Result};

/// The adapter that wgpu prefers; `CUBECL_WGPU_DEFAULT_DEVICE` (e.g. `IntegratedGpu(0)`) names another.
pub(super) fn open() -> Result<Opened> {
    // burn opens an adapter once; a second request would be refused
    static OPENED: OnceLock<Result<Opened, String>> = OnceLock::new();
    // elsewhere the choice would end at OpenGL, which nothing here was tried on
    let api = if cfg!(any(windows, target_os = "macos")) { WgpuBackend::Auto } else { WgpuBackend::Vulkan };
    let options = || Device::wgpu_options().graphics_api(api);
    let opened = OPENED.get_or_init(|| match options().init_with_setup() {
        Ok((device, setup)) => {
            let info = setup.adapter.get_info();
            Ok(Opened { device, name: info.name, software: info.device_type == DeviceType::Cpu })
        }
        Err(error) => Err(error.to_string()),
    });
    opened.clone().map_err(|cause| {
        Error::unsupported(format!(
            "device wgpu: there is no usable graphics adapter ({cause}): install a Vulkan driver (Mesa's, package \
             mesa-vulkan-drivers, also computes without a graphics card), or take device flex"
        ))
    })
}
