//! OpenEXR: a walk over the attributes of all parts.

use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use super::{Size, next};
use crate::limits::{MAX_EXR_ATTRIBUTES, MAX_EXR_HEADER_BYTES, MAX_EXR_PARTS, at_most};
use crate::{Error, Result};

/// Names of attributes and types, of which the format allows 255 bytes.
const MAX_NAME: u64 = 256;
/// Bit of the version field: several parts.
const MULTI_PART: u32 = 1 << 12;

/// # Errors
/// [`Error::TooLarge`] for a header beyond the limits.
pub(in crate::read) fn check(file: &mut (impl Read + Seek), path: &Path) -> Result<Size> {
    let mut reader = BufReader::with_capacity(1 << 14, file.by_ref());
    let size = walk(&mut reader).map_err(|e| Error::io(path, "read", e))?;
    file.rewind().map_err(|e| Error::io(path, "read", e))?;
    size
}

fn walk(file: &mut (impl BufRead + Seek)) -> std::io::Result<Result<Size>> {
    let Some([_, _, _, _, version @ ..]) = next::<8>(file)? else { return Ok(Ok(None)) };
    let several = u32::from_le_bytes(version) & MULTI_PART != 0;
    let (mut total, mut parts, mut attributes, mut size) = (8, 1, 0, None);
    loop {
        let Some(name) = word(file)? else { return Ok(Ok(size)) };
        total += name.len() as u64 + 1;
        if name.is_empty() {
            // the end of a part; of all parts, the second time
            if !several || attributes == 0 {
                return Ok(Ok(size));
            }
            (parts, attributes) = (parts + 1, 0);
            continue;
        }
        let Some(kind) = word(file)? else { return Ok(Ok(size)) };
        let Some(length) = next::<4>(file)?.map(u32::from_le_bytes) else { return Ok(Ok(size)) };
        total += kind.len() as u64 + 5 + u64::from(length);
        attributes += 1;
        let checked = at_most("bytes of header", total, MAX_EXR_HEADER_BYTES)
            .and_then(|()| at_most("attributes of a part", attributes, MAX_EXR_ATTRIBUTES as u64))
            .and_then(|()| at_most("parts", parts, MAX_EXR_PARTS as u64));
        if let Err(error) = checked {
            return Ok(Err(error));
        }
        let mut left = i64::from(length);
        if matches!(&name[..], b"displayWindow" | b"dataWindow") && length == 16 {
            let Some(window) = next::<16>(file)? else { return Ok(Ok(size)) };
            left = 0;
            size = larger(size, extent(window));
        }
        file.seek_relative(left)?;
    }
}

/// Bytes up to a zero; nothing where there is none within the longest name.
fn word(file: &mut impl BufRead) -> std::io::Result<Option<Vec<u8>>> {
    let mut name = Vec::new();
    file.take(MAX_NAME).read_until(0, &mut name)?;
    Ok((name.pop() == Some(0)).then_some(name))
}

/// Width and height of a box [x, y] to [x, y], both included.
fn extent(window: [u8; 16]) -> [u64; 2] {
    let [left, top, right, bottom] = [0, 4, 8, 12].map(|at| {
        i64::from(i32::from_le_bytes([window[at], window[at + 1], window[at + 2], window[at + 3]]))
    });
    [right - left + 1, bottom - top + 1].map(|n| u64::try_from(n).unwrap_or(0))
}

/// Of all windows, the one with the most pixels.
fn larger(size: Size, found: [u64; 2]) -> Size {
    let pixels = |size: [u64; 2]| size[0].saturating_mul(size[1]);
    Some(size.filter(|size| pixels(*size) >= pixels(found)).unwrap_or(found))
}
