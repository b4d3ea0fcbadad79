//! WebP: a walk over the chunks of its RIFF container.

use std::io::{Read, Seek};
use std::path::Path;

use super::{Size, next, skip};
use crate::limits::{MAX_METADATA_BYTES, MAX_METADATA_PIECES, MAX_PROFILE_BYTES, at_most};
use crate::{Error, Result};

pub(super) fn check(file: &mut (impl Read + Seek), length: u64, path: &Path) -> Result<Size> {
    let io = |e| Error::io(path, "read", e);
    let Some([_, _, _, _, a, b, c, d, ..]) = next::<12>(file).map_err(io)? else { return Ok(None) };
    let end = 8 + u64::from(u32::from_le_bytes([a, b, c, d]));
    let (mut size, mut at) = (None, 12);
    let (mut pieces, mut metadata) = (0, 0);
    // what lies behind the container is no part of it
    while at < end {
        let Some([name @ .., a, b, c, d]) = next::<8>(file).map_err(io)? else { break };
        let body = u64::from(u32::from_le_bytes([a, b, c, d]));
        at += 8;
        if body > length - at.min(length) {
            return Err(Error::invalid("truncated WebP file"));
        }
        let mut read = 0;
        match &name {
            b"VP8X" if body >= 10 => {
                let Some([_, _, _, _, a, b, c, d, e, f]) = next::<10>(file).map_err(io)? else { break };
                size = Some(
                    [[a, b, c], [d, e, f]].map(|[a, b, c]| 1 + u64::from(u32::from_le_bytes([a, b, c, 0]))),
                );
                read = 10;
            }
            b"VP8 " if body >= 10 && size.is_none() => {
                let Some([_, _, _, _, _, _, a, b, c, d]) = next::<10>(file).map_err(io)? else { break };
                size = Some([[a, b], [c, d]].map(|n| u64::from(u16::from_le_bytes(n) & 0x3FFF)));
                read = 10;
            }
            b"VP8L" if body >= 5 && size.is_none() => {
                let Some([_, bits @ ..]) = next::<5>(file).map_err(io)? else { break };
                let bits = u64::from(u32::from_le_bytes(bits));
                size = Some([1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)]);
                read = 5;
            }
            b"ICCP" => at_most("bytes of colour profile", body, MAX_PROFILE_BYTES)?,
            b"VP8 " | b"VP8L" | b"ALPH" | b"ANMF" => {}
            _ => {
                (pieces, metadata) = (pieces + 1, metadata + body);
                at_most("bytes of metadata", metadata, MAX_METADATA_BYTES)?;
                at_most("chunks of metadata", pieces, MAX_METADATA_PIECES as u64)?;
            }
        }
        // chunks are padded to even lengths
        skip(file, body + body % 2 - read).map_err(io)?;
        at += body + body % 2;
    }
    Ok(size)
}
