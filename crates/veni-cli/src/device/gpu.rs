//! Baking on a graphics device: which one, and its rows.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, anyhow, bail};
use veni_gpu::adapters::{self, Found, Opened};
use veni_gpu::read_back::{self, BakeLayout};
use veni_gpu::shader::Grid;
use veni_gpu::wgpu::AdapterInfo;
use veni_gpu::{GpuDecoder, GpuLatents};
use veni_light::latent::Latent;
use veni_light::light::Lights;
use veni_light::model::Model;
use veni_light::sphere::Frame;

use super::directions::Directions;
use super::on_cube::OnCube;
use crate::args::DecodeDevice;
use crate::output::Push;
use crate::report::Report;

/// What to say where no adapter is.
pub(crate) const NO_ADAPTER: &str = "no graphics device was found: install its driver (a Vulkan driver on Linux, where \
    the package mesa-vulkan-drivers also brings one in software)";

/// A model on a graphics device.
pub(crate) struct Gpu(Arc<Inner>);

struct Inner {
    name: String,
    opened: Opened,
    decoder: GpuDecoder,
}

/// A latent on a graphics device.
pub(crate) struct Conditioned {
    gpu: Arc<Inner>,
    latents: GpuLatents,
    /// In units of radiance; added to the rows that the device gives.
    lights: Lights,
}

/// All adapters, graphics cards first and software last.
pub(crate) fn list() -> Vec<Found> {
    pollster::block_on(adapters::list())
}

/// What an adapter is called in results: with its backend, since one card may be there under several.
pub(crate) fn name(info: &AdapterInfo) -> String {
    format!("{}, {}", info.name.trim(), info.backend)
}

/// The device for a choice, or nothing if that is the CPU.
pub(super) fn open(choice: DecodeDevice, model: &Model, report: Report) -> Result<Option<Gpu>> {
    let look = match choice {
        DecodeDevice::Cpu => false,
        DecodeDevice::Auto => may_have_card(),
        DecodeDevice::Gpu => true,
    };
    let adapters = if look { list() } else { Vec::new() };
    let Some(found) = pick(choice, &adapters, Found::is_software) else {
        if choice == DecodeDevice::Gpu {
            bail!("--device gpu: {NO_ADAPTER}, or use --device cpu");
        }
        return Ok(None);
    };
    let name = name(found.info());
    match Gpu::open(found, model) {
        Ok(gpu) => {
            if found.is_software() {
                report.note(format_args!("note: {name} is a software adapter; --device cpu is faster"));
            }
            Ok(Some(gpu))
        }
        Err(error) if choice == DecodeDevice::Auto => {
            let error = error.with_source();
            report.note(format_args!("note: {name} cannot be used ({error}); baking on the CPU"));
            Ok(None)
        }
        Err(error) => {
            let error = error.with_source();
            bail!("--device gpu: {name}: {error}; update its driver, or use --device cpu")
        }
    }
}

/// Whether this machine has what a card's driver talks to. Where it has not, starting the drivers costs a tenth of a
/// second for nothing, and Mesa's complain on stderr if there is no desktop either.
fn may_have_card() -> bool {
    let kernel_interfaces = ["/dev/dri", "/dev/nvidiactl", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0"];
    !cfg!(target_os = "linux") || kernel_interfaces.iter().any(|path| Path::new(path).exists())
}

/// The adapter for a choice, of those in the order of preference.
fn pick<T>(choice: DecodeDevice, adapters: &[T], is_software: impl Fn(&T) -> bool) -> Option<&T> {
    match choice {
        DecodeDevice::Cpu => None,
        DecodeDevice::Gpu => adapters.first(),
        DecodeDevice::Auto => adapters.iter().find(|adapter| !is_software(adapter)),
    }
}

impl Gpu {
    fn open(found: &Found, model: &Model) -> veni_gpu::Result<Self> {
        let opened = pollster::block_on(found.open())?;
        let decoder = GpuDecoder::new(&opened.device, model)?;
        Ok(Self(Arc::new(Inner { name: name(found.info()), opened, decoder })))
    }

    pub(super) fn name(&self) -> &str {
        &self.0.name
    }

    /// The device decodes vectors and lobes; lights, of which a code may have more than a shader has room for, are added here.
    pub(super) fn condition(&self, latent: &Latent) -> Result<Conditioned> {
        let dark = Latent { lights: Lights::default(), ..latent.clone() };
        let latents = self.0.decoder.condition(&self.0.opened.queue, &dark).map_err(|error| match error {
            veni_gpu::Error::Light(veni_light::Error::Unsupported { message, .. }) => {
                anyhow!("{message}; use --device cpu")
            }
            error => error.into(),
        })?;
        let lights = latent.lights.scaled(latent.log_exposure.exp());
        Ok(Conditioned { gpu: Arc::clone(&self.0), latents, lights })
    }
}

impl Conditioned {
    /// Hands over the rows of an image from the top. While one band is read, the next is computed.
    pub(super) fn rows(&self, directions: Directions, each: Push<'_>) -> veni_light::Result<()> {
        let Inner { name, opened, decoder } = &*self.gpu;
        let layout = layout(directions);
        let mut lit = Lit::new(&self.lights, directions);
        let rows = read_back::bake_rows(decoder, &opened.queue, &self.latents, layout, |at, row| {
            each(lit.row(at, row)).map_err(veni_gpu::Error::Light)
        });
        rows.map_err(|error| match error {
            // what `each` said is not a fault of the device
            veni_gpu::Error::Light(error) => error,
            error => {
                veni_light::Error::unsupported(format!("{name}: {}; try --device cpu", error.with_source()))
            }
        })
    }
}

/// Rows with their lights.
struct Lit<'a> {
    lights: &'a Lights,
    directions: Directions,
    cube: Option<OnCube>,
    row: Vec<[f32; 3]>,
}

impl<'a> Lit<'a> {
    fn new(lights: &'a Lights, directions: Directions) -> Self {
        let cube = match directions {
            Directions::Cube { edge, frame } => Some(OnCube::new(lights, frame, edge)),
            Directions::Equirect(_) => None,
        };
        Self { lights, directions, cube, row: Vec::new() }
    }

    /// The row that comes next, `at` from the top.
    fn row<'r>(&'r mut self, at: usize, row: &'r [[f32; 3]]) -> &'r [[f32; 3]] {
        if self.lights.is_empty() {
            return row;
        }
        self.row.clear();
        self.row.extend_from_slice(row);
        match (self.directions, &mut self.cube) {
            (_, Some(cube)) => cube.add_to(&mut self.row),
            (Directions::Equirect(grid), None) => self.lights.add_to_rows(grid, at..at + 1, &mut self.row),
            (Directions::Cube { .. }, None) => {}
        }
        &self.row
    }
}

/// Sides fit in 32 bits: `--size` allows far less.
fn layout(directions: Directions) -> BakeLayout {
    match directions {
        Directions::Equirect(grid) => BakeLayout {
            grid: Grid::Equirect { width: grid.width as u32, height: grid.height as u32 },
            frame: Frame::default(),
        },
        Directions::Cube { edge, frame } => BakeLayout { grid: Grid::Cube { size: edge as u32 }, frame },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn software_is_taken_only_when_asked_for() {
        let pick = |choice, adapters: &[&'static str]| {
            pick(choice, adapters, |name| name.starts_with("soft")).copied()
        };
        let (auto, cpu, gpu) = (DecodeDevice::Auto, DecodeDevice::Cpu, DecodeDevice::Gpu);
        for (adapters, by_auto, by_gpu) in [
            (&["card", "other", "soft"][..], Some("card"), Some("card")),
            (&["soft", "softer", "card"], Some("card"), Some("soft")),
            (&["soft", "softer"], None, Some("soft")),
            (&[], None, None),
        ] {
            assert_eq!(pick(auto, adapters), by_auto, "{adapters:?}");
            assert_eq!(pick(gpu, adapters), by_gpu, "{adapters:?}");
            assert_eq!(pick(cpu, adapters), None, "{adapters:?}");
        }
    }
}
