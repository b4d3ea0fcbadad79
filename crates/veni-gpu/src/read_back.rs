//! Results on the CPU: a convenience that submits and waits. A renderer's frame does without it.

use std::ops::Range;
use std::sync::mpsc;

use veni_light::sphere::Frame;
use wgpu::{
    Buffer, BufferDescriptor, BufferUsages, Device, MapMode, Origin3d, PollType, Queue, TexelCopyBufferInfo,
    TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect, TextureFormat,
};

use crate::decoder::{Bake, GpuDecoder, GpuLatents, count};
use crate::error::{Error, Result};
use crate::scope::guarded;
use crate::shader::Grid;

/// Bytes of a band of rows: small enough for every device's bindings and for memory, large enough to keep it busy.
const BAND_BYTES: u64 = 32 << 20;

/// What rows are baked of: a panorama or stacked cube faces, in a frame.
#[derive(Clone, Copy, Debug)]
pub struct BakeLayout {
    /// The whole grid.
    pub grid: Grid,
    /// Axes that cube faces are named by.
    pub frame: Frame,
}

/// Bakes the first latent and hands the rows over one by one, from the top, as
/// [`Field::bake_rows`](veni_light::field::Field::bake_rows) does. While one band is read, the next is computed; however
/// large the whole, two bands are held.
///
/// # Errors
/// What [`GpuDecoder::bake`] says; [`Error::Gpu`] if the device is lost; the first error of `each_row`, which ends the work.
pub fn bake_rows<E: From<Error>>(
    decoder: &GpuDecoder,
    queue: &Queue,
    latents: &GpuLatents,
    layout: BakeLayout,
    mut each_row: impl FnMut(usize, &[[f32; 3]]) -> Result<(), E>,
) -> Result<(), E> {
    if let Grid::List { .. } = layout.grid {
        return Err(Error::invalid("a list of directions has no rows").into());
    }
    let latents = &latents.first();
    let width = layout.grid.width();
    let height = count(layout.grid)? / width;
    let row_bytes = 16 * u64::from(width);
    let band = (BAND_BYTES / row_bytes).clamp(1, u64::from(height)) as u32;
    let device = decoder.device();
    let size = row_bytes * u64::from(band);
    let make = |label, usage| {
        let descriptor = BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        guarded(device, label, || device.create_buffer(&descriptor))
    };
    let radiance = make("veni rows", BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
    let host = [0, 1].map(|_| make("veni rows, host", BufferUsages::MAP_READ | BufferUsages::COPY_DST));
    let [one, two] = host;
    let host = [one?, two?];
    let start = |rows: Range<u32>, into: &Buffer| -> Result<Pending> {
        let mut encoder = encoder(device)?;
        let bake = Bake::rows(&radiance, layout.grid, rows.clone()).frame(layout.frame);
        decoder.bake(&mut encoder, latents, &bake)?;
        let bytes = 16 * u64::from(width) * u64::from(rows.end - rows.start);
        encoder.copy_buffer_to_buffer(&radiance, 0, into, 0, bytes);
        submit(device, queue, encoder, into, bytes)
    };
    let bands: Vec<_> = (0..height).step_by(band as usize).map(|r| r..height.min(r + band)).collect();
    let mut pending = Some(start(bands[0].clone(), &host[0])?);
    let mut pixels = Vec::new();
    for (i, rows) in bands.iter().enumerate() {
        let next = match bands.get(i + 1) {
            Some(rows) => Some(start(rows.clone(), &host[(i + 1) % 2])?),
            None => None,
        };
        let Some(now) = std::mem::replace(&mut pending, next) else { break };
        now.read(device, &host[i % 2], &mut pixels)?;
        for (row, pixels) in rows.clone().zip(pixels.chunks_exact(width as usize)) {
            each_row(row as usize, pixels)?;
        }
    }
    Ok(())
}

/// The RGB of every vec4f in a buffer of usage `COPY_SRC`.
///
/// # Errors
/// [`Error::Invalid`] if its size is not that of one vec4f or more; [`Error::Gpu`] if it cannot be copied or the device
/// is lost.
pub fn buffer(device: &Device, queue: &Queue, from: &Buffer) -> Result<Vec<[f32; 3]>> {
    let size = from.size();
    if size == 0 || !size.is_multiple_of(16) {
        return Err(Error::invalid(format!("a buffer of {size} bytes does not hold whole vec4f")));
    }
    let host = host_buffer(device, size)?;
    let mut encoder = encoder(device)?;
    encoder.copy_buffer_to_buffer(from, 0, &host, 0, size);
    let mut pixels = Vec::new();
    submit(device, queue, encoder, &host, size)?.read(device, &host, &mut pixels)?;
    Ok(pixels)
}

/// The RGB of a texture in `Rgba32Float` or `Rgba16Float` with usage `COPY_SRC`, row-major, layer after layer.
///
/// # Errors
/// [`Error::Invalid`] for another format; [`Error::Gpu`] if it cannot be copied or the device is lost.
pub fn texture(device: &Device, queue: &Queue, from: &Texture) -> Result<Vec<[f32; 3]>> {
    let half = match from.format() {
        TextureFormat::Rgba32Float => false,
        TextureFormat::Rgba16Float => true,
        other => return Err(Error::invalid(format!("a texture of format {other:?} holds no radiance"))),
    };
    let (width, height, layers) = (from.width(), from.height(), from.depth_or_array_layers());
    let row = width * if half { 8 } else { 16 };
    // rows of a copy begin at multiples of 256 bytes
    let stride = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let size = u64::from(stride) * u64::from(height) * u64::from(layers);
    let host = host_buffer(device, size)?;
    let mut encoder = encoder(device)?;
    let source = TexelCopyTextureInfo {
        texture: from,
        mip_level: 0,
        origin: Origin3d::ZERO,
        aspect: TextureAspect::All,
    };
    let layout =
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride), rows_per_image: Some(height) };
    let size_of_copy = wgpu::Extent3d { width, height, depth_or_array_layers: layers };
    encoder.copy_texture_to_buffer(source, TexelCopyBufferInfo { buffer: &host, layout }, size_of_copy);
    let mut bytes = Vec::new();
    submit(device, queue, encoder, &host, size)?.bytes(device, &host, &mut bytes)?;
    let rows = bytes.chunks_exact(stride as usize).map(|bytes| &bytes[..row as usize]);
    let texels = rows.flat_map(|bytes| bytes.chunks_exact(if half { 8 } else { 16 }));
    let rgb = |texel: &[u8]| match half {
        true => std::array::from_fn(|c| half::f16::from_le_bytes([texel[2 * c], texel[2 * c + 1]]).to_f32()),
        false => std::array::from_fn(|c| bytemuck::pod_read_unaligned(&texel[4 * c..4 * c + 4])),
    };
    Ok(texels.map(rgb).collect())
}

fn encoder(device: &Device) -> Result<wgpu::CommandEncoder> {
    let descriptor = wgpu::CommandEncoderDescriptor { label: Some("veni read back") };
    guarded(device, "veni read back", || device.create_command_encoder(&descriptor))
}

fn host_buffer(device: &Device, size: u64) -> Result<Buffer> {
    let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
    let descriptor =
        BufferDescriptor { label: Some("veni read back"), size, usage, mapped_at_creation: false };
    guarded(device, "veni read back", || device.create_buffer(&descriptor))
}

/// A copy under way.
struct Pending {
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
    submission: wgpu::SubmissionIndex,
    bytes: u64,
}

fn submit(
    device: &Device,
    queue: &Queue,
    encoder: wgpu::CommandEncoder,
    into: &Buffer,
    bytes: u64,
) -> Result<Pending> {
    let (send, mapped) = mpsc::channel();
    let submission = guarded(device, "submission", || {
        let submission = queue.submit([encoder.finish()]);
        into.slice(..bytes).map_async(MapMode::Read, move |result| {
            // nobody listens any more if the reader gave up
            let _ = send.send(result);
        });
        submission
    })?;
    Ok(Pending { mapped, submission, bytes })
}

impl Pending {
    /// Waits, and replaces `out` by the RGB of every vec4f.
    fn read(self, device: &Device, host: &Buffer, out: &mut Vec<[f32; 3]>) -> Result<()> {
        out.clear();
        self.mapped(device, host, |bytes| {
            out.extend(bytemuck::cast_slice::<u8, [f32; 4]>(bytes).iter().map(|[r, g, b, _]| [*r, *g, *b]));
        })
    }

    fn bytes(self, device: &Device, host: &Buffer, out: &mut Vec<u8>) -> Result<()> {
        self.mapped(device, host, |bytes| out.extend_from_slice(bytes))
    }

    fn mapped(self, device: &Device, host: &Buffer, mut use_bytes: impl FnMut(&[u8])) -> Result<()> {
        let Self { mapped, submission, bytes } = self;
        const WHAT: &str = "reading results back";
        // this submission only: the next may go on
        let wait = PollType::Wait { submission_index: Some(submission), timeout: None };
        device.poll(wait).map_err(|e| Error::gpu(WHAT, e))?;
        mapped.recv().map_err(|e| Error::gpu(WHAT, e))?.map_err(|e| Error::gpu(WHAT, e))?;
        let view = host.slice(..bytes).get_mapped_range().map_err(|e| Error::gpu(WHAT, e))?;
        use_bytes(&view);
        drop(view);
        host.unmap();
        Ok(())
    }
}
