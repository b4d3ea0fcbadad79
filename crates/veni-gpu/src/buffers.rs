//! Buffers with their content.

use wgpu::{Buffer, BufferDescriptor, BufferUsages, Device};

use crate::error::{Error, Result};
use crate::scope::guarded;

/// A read-only storage buffer with its content. Mapped at creation: no queue, no submission.
pub(crate) fn storage(device: &Device, label: &str, bytes: &[u8]) -> Result<Buffer> {
    let (size, most) = (bytes.len() as u64, device.limits().max_storage_buffer_binding_size);
    if size > most {
        return Err(Error::unsupported(format!(
            "{label} take {size} bytes, the device binds at most {most} (max_storage_buffer_binding_size)"
        )));
    }
    filled(device, label, BufferUsages::STORAGE, bytes)
}

/// A buffer with its content, of a length that is a multiple of four.
pub(crate) fn filled(device: &Device, label: &str, usage: BufferUsages, bytes: &[u8]) -> Result<Buffer> {
    let descriptor =
        BufferDescriptor { label: Some(label), size: bytes.len() as u64, usage, mapped_at_creation: true };
    let buffer = guarded(device, label, || device.create_buffer(&descriptor))?;
    let mut mapped = buffer.slice(..).get_mapped_range_mut().map_err(|e| Error::gpu(label, e))?;
    mapped.copy_from_slice(bytes);
    drop(mapped);
    buffer.unmap();
    Ok(buffer)
}
