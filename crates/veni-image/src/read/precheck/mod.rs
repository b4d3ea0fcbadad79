//! What is looked at before a decoder sees a file: sizes, counts and the few values on which decoders panic or loop. Nothing
//! here allocates by a number from the file.
//!
//! Every check leaves the file at its beginning. A file that passes may still be damaged: that the decoder finds.

mod exr;
mod hdr;
mod jpeg;
mod png;
mod webp;

use std::io::{BufRead, Read, Result as IoResult, Seek, SeekFrom};
use std::path::Path;

use image::ImageFormat;

use super::ReadOptions;
use crate::limits::{BYTES_PER_FILE, MAX_FILE_BYTES, READ_BYTES_PER_PIXEL, at_most};
use crate::{Error, Result, memory};

pub(super) use self::exr::check as exr;
pub(super) use self::hdr::check as hdr;

/// The size that a header declares, where it was found.
pub(super) type Size = Option<[u64; 2]>;

/// What is looked at in a PNG, JPEG or WebP file; AVIF has a check of its own ([`super::avif`]).
///
/// # Errors
/// [`Error::TooLarge`] beyond a limit of [`crate::limits`], [`Error::Invalid`] for what makes a decoder panic.
pub(super) fn ldr(file: &mut (impl BufRead + Seek), path: &Path, format: ImageFormat) -> Result<Size> {
    let io = |e| Error::io(path, "read", e);
    let length = length(file).map_err(io)?;
    at_most("bytes of file", length, MAX_FILE_BYTES)?;
    let size = match format {
        ImageFormat::Png => png::check(file, path),
        ImageFormat::Jpeg => jpeg::check(file, path),
        ImageFormat::WebP => webp::check(file, length, path),
        _ => Ok(None),
    };
    file.rewind().map_err(io)?;
    size
}

/// Bytes that work on a file takes at its peak, by the size that its header declares and the bytes for each pixel; nothing
/// where no size is found, or where it is beyond what `options` allow: such a file is refused before its pixels are allocated.
pub(super) fn peak(size: Size, each: u64, options: &ReadOptions) -> Option<u64> {
    let [width, height] = size?;
    let pixels = width.checked_mul(height).filter(|n| *n <= options.max_pixels as u64)?;
    Some(BYTES_PER_FILE + pixels * each)
}

/// # Errors
/// [`Error::TooLarge`] if the memory does not hold what reading a file of this size takes.
pub(super) fn budget(size: Size, options: &ReadOptions) -> Result<()> {
    peak(size, READ_BYTES_PER_PIXEL, options).map_or(Ok(()), memory::check)
}

fn length(file: &mut impl Seek) -> IoResult<u64> {
    let length = file.seek(SeekFrom::End(0))?;
    file.rewind()?;
    Ok(length)
}

/// The next `N` bytes, nothing where the file ends before.
fn next<const N: usize>(file: &mut impl Read) -> IoResult<Option<[u8; N]>> {
    let mut bytes = [0; N];
    let mut filled = 0;
    while filled < N {
        match file.read(&mut bytes[filled..]) {
            Ok(0) => return Ok(None),
            Ok(count) => filled += count,
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(Some(bytes))
}

/// Steps over `count` bytes.
fn skip(file: &mut impl Seek, count: u64) -> IoResult<()> {
    let count = i64::try_from(count).map_err(|_| std::io::Error::from(std::io::ErrorKind::InvalidData))?;
    file.seek_relative(count)
}

#[cfg(test)]
mod tests;
