//! PNG (ISO/IEC 15948): a walk over its chunks.
//!
//! The decoder panics on a palette whose length is not a multiple of three or beyond 256 entries, and inflates a colour
//! profile in one piece (docs/UPSTREAM.md).

use std::io::{BufRead, Read, Seek};
use std::path::Path;

use miniz_oxide::inflate::stream::{InflateState, inflate};
use miniz_oxide::{DataFormat, MZError, MZFlush, MZStatus};

use super::{Size, next, skip};
use crate::limits::{MAX_METADATA_BYTES, MAX_METADATA_PIECES, MAX_PROFILE_BYTES, at_most};
use crate::{Error, Result};

/// Colour type of images with a palette.
const INDEXED: u8 = 3;

pub(super) fn check(file: &mut (impl BufRead + Seek), path: &Path) -> Result<Size> {
    let (size, entries, depth) = walk(file, path)?;
    // the decoder paints indices beyond the palette black
    if let Some(entries) = entries.filter(|entries| *entries < 1 << depth) {
        file.rewind().map_err(|e| Error::io(path, "read", e))?;
        indices(file, size, entries, depth)?;
    }
    Ok(size)
}

/// The size, and of images with a palette its entries and the bits of an index.
fn walk(file: &mut (impl Read + Seek), path: &Path) -> Result<(Size, Option<u64>, u8)> {
    let io = |e| Error::io(path, "read", e);
    skip(file, 8).map_err(io)?;
    let (mut size, mut kind, mut entries) = (None, [0; 2], None);
    let (mut pieces, mut metadata) = (0, 0);
    while let Some([a, b, c, d, name @ ..]) = next::<8>(file).map_err(io)? {
        let length = u64::from(u32::from_be_bytes([a, b, c, d]));
        if size.is_none() && &name != b"IHDR" {
            return Err(Error::invalid("damaged PNG file: it does not begin with its header"));
        }
        match &name {
            b"IHDR" if size.is_none() => {
                let header = next::<13>(file).map_err(io)?.filter(|_| length == 13);
                let Some([a, b, c, d, e, f, g, h, depth, colour, ..]) = header else {
                    return Err(Error::invalid(format!("damaged PNG file: a header of {length} bytes")));
                };
                size = Some([[a, b, c, d], [e, f, g, h]].map(|n| u64::from(u32::from_be_bytes(n))));
                kind = [depth, colour];
                skip(file, 4).map_err(io)?;
                continue;
            }
            b"PLTE" => {
                palette(length, kind)?;
                entries = Some(length / 3).filter(|_| kind[1] == INDEXED);
            }
            b"iCCP" => {
                at_most("bytes of compressed colour profile", length, MAX_PROFILE_BYTES)?;
                let mut chunk = Vec::new();
                file.take(length).read_to_end(&mut chunk).map_err(io)?;
                profile(&chunk)?;
                skip(file, 4).map_err(io)?;
                continue;
            }
            b"IDAT" | b"fdAT" => {}
            b"IEND" => break,
            _ => {
                (pieces, metadata) = (pieces + 1, metadata + length);
                at_most("bytes of metadata", metadata, MAX_METADATA_BYTES)?;
                at_most("chunks of metadata", pieces, MAX_METADATA_PIECES as u64)?;
            }
        }
        skip(file, length + 4).map_err(io)?;
    }
    Ok((size, entries, kind[0]))
}

/// Refuses images with an index beyond the palette. What else is wrong with the file, the decoder says later.
fn indices(file: &mut (impl BufRead + Seek), size: Size, entries: u64, depth: u8) -> Result<()> {
    let limits = png::Limits { bytes: MAX_METADATA_BYTES as usize };
    let Ok(mut reader) = png::Decoder::new_with_limits(file, limits).read_info() else { return Ok(()) };
    let width = size.map_or(0, |[width, _]| width);
    while let Ok(Some(row)) = reader.next_interlaced_row() {
        let bits = usize::from(depth.clamp(1, 8));
        let each = 8 / bits;
        // rows of a pass are shorter, and end with bits that are no pixels
        let interlaced = !matches!(row.interlace(), png::InterlaceInfo::Null(_));
        let count = if interlaced { row.data().len() * each } else { width as usize };
        if interlaced && each > 1 {
            return Ok(());
        }
        let mask = (1_u16 << bits) as u8;
        let index = |x: usize| row.data()[x / each] >> (8 - bits - bits * (x % each)) & mask.wrapping_sub(1);
        if let Some(found) =
            (0..count.min(row.data().len() * each)).map(index).find(|i| u64::from(*i) >= entries)
        {
            return Err(Error::invalid(format!(
                "damaged PNG file: a pixel has colour {found} of a palette of {entries}"
            )));
        }
    }
    Ok(())
}

/// A palette has 1 to 2ⁿ entries of three bytes, with n bits to an index.
fn palette(length: u64, [depth, colour]: [u8; 2]) -> Result<()> {
    if length == 0 || !length.is_multiple_of(3) || length > 768 {
        return Err(Error::invalid(format!(
            "damaged PNG file: a palette of {length} bytes; it must have 1 to 256 entries of 3"
        )));
    }
    let most =
        if colour == INDEXED { 1_u64.checked_shl(u32::from(depth)).unwrap_or(256).min(256) } else { 256 };
    if length / 3 > most {
        return Err(Error::invalid(format!(
            "damaged PNG file: a palette of {} entries for indices of {depth} bits",
            length / 3
        )));
    }
    Ok(())
}

/// Inflates a profile without keeping it, up to the limit.
fn profile(chunk: &[u8]) -> Result<()> {
    // name, zero byte, method
    let Some(end) = chunk.iter().position(|b| *b == 0) else { return Ok(()) };
    let mut rest = chunk.get(end + 2..).unwrap_or_default();
    let (mut state, mut scratch) = (InflateState::new_boxed(DataFormat::Zlib), vec![0; 1 << 16]);
    let mut total = 0;
    loop {
        let step = inflate(&mut state, rest, &mut scratch, MZFlush::None);
        rest = &rest[step.bytes_consumed..];
        total += step.bytes_written as u64;
        at_most("bytes of colour profile", total, MAX_PROFILE_BYTES)?;
        match step.status {
            Ok(MZStatus::Ok) if step.bytes_consumed > 0 || step.bytes_written > 0 => {}
            Err(MZError::Buf) if step.bytes_written > 0 => {}
            // the end, or damaged: whoever asks for its colours refuses it
            _ => return Ok(()),
        }
    }
}
