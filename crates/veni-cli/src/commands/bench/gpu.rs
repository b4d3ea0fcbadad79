//! A graphics device as something that bakes: what is timed is a submission and the wait for its end.

use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use veni_gpu::adapters::{Found, Opened};
use veni_gpu::shader::Grid;
use veni_gpu::wgpu::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Device, ErrorFilter, Extent3d,
    PollType, Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
};
use veni_gpu::{Bake, GpuDecoder, GpuLatents, probe};
use veni_light::sphere::Equirect;

use super::cases::Case;
use super::subject::{Bakes, Subject};
use crate::device::gpu;

/// Bytes of a pixel in a buffer: four f32.
const PIXEL: u64 = 16;

/// An adapter, opened when it is its turn.
pub(super) struct Gpu {
    name: String,
    found: Found,
    opened: Option<Opened>,
}

impl Gpu {
    pub(super) fn new(found: Found) -> Self {
        Self { name: gpu::name(found.info()), found, opened: None }
    }

    fn open(&mut self) -> Result<&Opened> {
        let opened = match self.opened.take() {
            Some(opened) => opened,
            None => pollster::block_on(self.found.open())?,
        };
        Ok(self.opened.insert(opened))
    }

    fn loaded(&mut self, case: &Case) -> Result<Loaded> {
        let opened = self.open()?.clone();
        let decoder = GpuDecoder::new(&opened.device, &case.model)?;
        let latents = decoder.condition(&opened.queue, &case.latent)?;
        Ok(Loaded { limits: Limits::of(&opened.device), opened, decoder, latents, target: None })
    }
}

impl Subject for Gpu {
    fn name(&self) -> &str {
        &self.name
    }

    fn multiply_add_rate(&mut self) -> Result<f64> {
        let opened = self.open()?;
        Ok(probe::multiply_add_rate(&opened.device, &opened.queue)?)
    }

    fn load(&mut self, case: &Case) -> Result<Box<dyn Bakes>> {
        Ok(Box::new(self.loaded(case)?))
    }
}

/// A latent on the device, and where it was baked last.
struct Loaded {
    opened: Opened,
    decoder: GpuDecoder,
    latents: GpuLatents,
    limits: Limits,
    target: Option<(Equirect, Target)>,
}

impl Bakes for Loaded {
    fn bake(&mut self, grid: Equirect) -> Result<Duration> {
        let Opened { device, queue, .. } = &self.opened;
        let target = match self.target.take() {
            Some((of, target)) if of == grid => target,
            // the old one is gone by now: two large ones may not fit
            _ => Target::new(device, self.limits, grid)?,
        };
        let mut encoder =
            checked(device, || device.create_command_encoder(&CommandEncoderDescriptor::default()))?;
        for bake in target.bakes(grid) {
            self.decoder.bake(&mut encoder, &self.latents, &bake)?;
        }
        let commands = checked(device, || encoder.finish())?;
        let time = checked(device, || {
            let started = Instant::now();
            queue.submit([commands]);
            device.poll(PollType::wait_indefinitely()).map(|_| started.elapsed())
        })??;
        self.target = Some((grid, target));
        Ok(time)
    }
}

/// What a device allows.
#[derive(Clone, Copy)]
struct Limits {
    /// Bytes of a storage buffer.
    bytes: u64,
    /// Pixels along a texture's side.
    side: u32,
}

impl Limits {
    fn of(device: &Device) -> Self {
        let limits = device.limits();
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        Self { bytes, side: limits.max_texture_dimension_2d }
    }
}

/// Where radiance goes.
enum Target {
    /// Some rows of pixels, or the whole panorama; used again for the rows that follow.
    Rows(Buffer, u32),
    /// In half precision.
    Texture(Texture),
}

impl Target {
    /// A buffer where the device binds one of that size, else a texture where it has one, else a buffer for a part.
    fn new(device: &Device, limits: Limits, grid: Equirect) -> Result<Self> {
        let (width, height) = (grid.width as u32, grid.height as u32);
        let row = PIXEL * u64::from(width);
        if row * u64::from(height) > limits.bytes && width <= limits.side && height <= limits.side {
            let descriptor = TextureDescriptor {
                label: Some("veni bench"),
                size: Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: TextureFormat::Rgba16Float,
                usage: TextureUsages::STORAGE_BINDING,
                view_formats: &[],
            };
            return checked(device, || Self::Texture(device.create_texture(&descriptor)));
        }
        let rows = (limits.bytes / row).clamp(1, u64::from(height)) as u32;
        let descriptor = BufferDescriptor {
            label: Some("veni bench"),
            size: row * u64::from(rows),
            usage: BufferUsages::STORAGE,
            mapped_at_creation: false,
        };
        checked(device, || Self::Rows(device.create_buffer(&descriptor), rows))
    }

    /// The bakes that make up the panorama.
    fn bakes(&self, grid: Equirect) -> Vec<Bake<'_>> {
        let (width, height) = (grid.width as u32, grid.height as u32);
        match self {
            Self::Texture(texture) => vec![Bake::equirect(texture)],
            Self::Rows(buffer, rows) => {
                let band = |first| first..height.min(first + rows);
                let bands = (0..height).step_by(*rows as usize).map(band);
                bands.map(|rows| Bake::rows(buffer, Grid::Equirect { width, height }, rows)).collect()
            }
        }
    }
}

/// Runs `work`, and makes an error of what the device says against it (no memory, mostly) instead of a panic.
fn checked<T>(device: &Device, work: impl FnOnce() -> T) -> Result<T> {
    let scopes = [ErrorFilter::Internal, ErrorFilter::Validation, ErrorFilter::OutOfMemory]
        .map(|filter| device.push_error_scope(filter));
    let made = work();
    let mut error = None;
    // the innermost first
    for scope in scopes.into_iter().rev() {
        error = error.or(pollster::block_on(scope.pop()));
    }
    error.map_or(Ok(made), |error| Err(anyhow!("{error}")))
}

#[cfg(test)]
mod tests {
    use veni_light::model::{Model, ModelConfig};

    use super::*;

    /// The first adapter. Without one the test fails, unless it is to be left out.
    fn adapter() -> Option<Found> {
        if std::env::var_os("VENI_SKIP_GPU").is_some_and(|v| v == "1") {
            eprintln!("skipped, since VENI_SKIP_GPU=1 is set");
            return None;
        }
        Some(gpu::list().into_iter().next().expect("a graphics device, or VENI_SKIP_GPU=1"))
    }

    /// Small limits stand in for large panoramas, which take too long on a software device.
    #[test]
    fn a_panorama_goes_where_there_is_room_for_it() {
        let Some(found) = adapter() else { return };
        let case = Case::new("formula", Model::filler(&ModelConfig::decode_only(2), 1).unwrap(), 0);
        let mut loaded = Gpu::new(found).loaded(&case).unwrap();
        let grid = Equirect::new(32, 16);
        let row = 32 * PIXEL;
        for (bytes, side, bakes, in_texture) in [
            (16 * row, 32, 1, false),
            (16 * row - 1, 32, 1, true),
            (16 * row - 1, 31, 2, false),
            (5 * row, 31, 4, false),
        ] {
            loaded.limits = Limits { bytes, side };
            loaded.target = None;
            assert!(loaded.bake(grid).unwrap() > Duration::ZERO);
            let (_, target) = loaded.target.as_ref().unwrap();
            assert_eq!(target.bakes(grid).len(), bakes, "{bytes} bytes, side {side}");
            assert_eq!(matches!(target, Target::Texture(_)), in_texture, "{bytes} bytes, side {side}");
        }
    }

    #[test]
    fn what_the_device_refuses_is_an_error() {
        let Some(found) = adapter() else { return };
        let opened = pollster::block_on(found.open()).unwrap();
        let limits = Limits { bytes: u64::MAX, side: 0 };
        assert!(Target::new(&opened.device, limits, Equirect::new(1 << 20, 1 << 19)).is_err());
    }
}
