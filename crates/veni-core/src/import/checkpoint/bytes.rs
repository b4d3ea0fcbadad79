//! Little-endian reads that cannot leave the file.

use crate::{Error, Result};

/// `count` bytes from `start`.
pub(super) fn at(file: &[u8], start: usize, count: usize) -> Result<&[u8]> {
    let end = start.checked_add(count);
    end.and_then(|end| file.get(start..end))
        .ok_or_else(|| Error::invalid(format!("truncated: {count} bytes from {start} are not there")))
}

/// `N` bytes from `start`, as an array.
pub(super) fn array<const N: usize>(file: &[u8], start: usize) -> Result<[u8; N]> {
    let mut out = [0; N];
    out.copy_from_slice(at(file, start, N)?);
    Ok(out)
}

/// An unsigned 16-bit number.
pub(super) fn u16_at(file: &[u8], start: usize) -> Result<usize> {
    Ok(usize::from(u16::from_le_bytes(array(file, start)?)))
}

/// An unsigned 32-bit number.
pub(super) fn u32_at(file: &[u8], start: usize) -> Result<usize> {
    Ok(u32::from_le_bytes(array(file, start)?) as usize)
}
