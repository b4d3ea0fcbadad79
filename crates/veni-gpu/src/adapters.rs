//! Finding and opening a device: a convenience for programs that have none of their own. Hosts that render hand theirs
//! to [`GpuDecoder::new`](crate::GpuDecoder::new) and need nothing here.

use std::fmt;

use wgpu::{
    Adapter, AdapterInfo, Device, DeviceDescriptor, DeviceType, Features, Instance, InstanceDescriptor,
    Limits, Queue,
};

use crate::error::{Error, Result};

/// An adapter of this machine.
#[derive(Clone, Debug)]
pub struct Found {
    adapter: Adapter,
    info: AdapterInfo,
}

/// An opened device.
#[derive(Clone, Debug)]
pub struct Opened {
    /// The device.
    pub device: Device,
    /// Its queue.
    pub queue: Queue,
    /// What it is.
    pub info: AdapterInfo,
}

/// All adapters that can run the decoder, graphics cards first, then integrated ones, then software. The usual variables
/// of wgpu (`WGPU_BACKEND`, …) limit the choice, or widen it to OpenGL where that is compiled in.
pub async fn list() -> Vec<Found> {
    if Instance::enabled_backend_features().is_empty() {
        return Vec::new();
    }
    let mut descriptor = InstanceDescriptor::new_without_display_handle_from_env();
    if std::env::var_os("WGPU_BACKEND").is_none() {
        // burn switches OpenGL on in the wgpu of a whole program, where it would list the same adapters once more
        descriptor.backends &= wgpu::Backends::PRIMARY;
    }
    let instance = Instance::new(descriptor);
    let adapters = instance.enumerate_adapters(wgpu::Backends::all()).await;
    let mut found: Vec<_> = adapters
        .into_iter()
        .filter(|adapter| {
            adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
        })
        .map(|adapter| Found { info: adapter.get_info(), adapter })
        .collect();
    found.sort_by_key(|f| match f.info.device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    });
    found
}

impl Found {
    /// Name, driver, kind, backend.
    pub fn info(&self) -> &AdapterInfo {
        &self.info
    }

    /// Whether it computes on the CPU (lavapipe, SwiftShader, WARP): never faster than
    /// [`Field::bake`](veni_light::field::Field::bake).
    pub fn is_software(&self) -> bool {
        self.info.device_type == DeviceType::Cpu
    }

    /// What it allows at most.
    pub fn limits(&self) -> Limits {
        self.adapter.limits()
    }

    /// Optional features that the decoder would use.
    pub fn useful_features(&self) -> Features {
        self.adapter.features() & (Features::SHADER_F16 | Features::SUBGROUP)
    }

    /// Opens it with all that the decoder can use: large bindings and workgroup memory, f16 and subgroups where it has
    /// them.
    ///
    /// # Errors
    /// [`Error::Gpu`] with the driver's reason.
    pub async fn open(&self) -> Result<Opened> {
        self.open_with(self.useful_features(), self.limits()).await
    }

    /// Opens it as a browser or a cautious host would: WebGPU's default limits and no optional feature.
    ///
    /// # Errors
    /// [`Error::Gpu`] with the driver's reason.
    pub async fn open_plain(&self) -> Result<Opened> {
        self.open_with(Features::empty(), Limits::default()).await
    }

    async fn open_with(&self, required_features: Features, required_limits: Limits) -> Result<Opened> {
        let descriptor = DeviceDescriptor {
            label: Some("veni"),
            required_features,
            required_limits,
            ..DeviceDescriptor::default()
        };
        let opened = self.adapter.request_device(&descriptor).await;
        let (device, queue) = opened.map_err(|e| Error::gpu(format!("opening {self}"), e))?;
        Ok(Opened { device, queue, info: self.info.clone() })
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&Named(&self.info), f)
    }
}

impl fmt::Display for Opened {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&Named(&self.info), f)
    }
}

struct Named<'a>(&'a AdapterInfo);

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let AdapterInfo { name, driver, driver_info, backend, .. } = self.0;
        write!(f, "{name} ({backend}, {driver} {driver_info})")
    }
}
