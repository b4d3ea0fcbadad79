//! Radiance: lines of text up to an empty one, then the resolution.

use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use super::Size;
use crate::limits::{MAX_HDR_HEADER_BYTES, MAX_HDR_HEADER_LINES, at_most};
use crate::read::hdr::line_end;
use crate::{Error, Result};

/// # Errors
/// [`Error::TooLarge`] for a header without an end within the limits.
pub(in crate::read) fn check(file: &mut (impl Read + Seek), path: &Path) -> Result<Size> {
    let io = |e| Error::io(path, "read", e);
    // by reference and limited: a line without an end is not read to it
    let mut header = BufReader::new(file.by_ref().take(MAX_HDR_HEADER_BYTES + 1));
    let end = line_end(header.fill_buf().map_err(io)?);
    let (mut bytes, mut lines, mut size) = (0, 0, None);
    let mut line = Vec::new();
    loop {
        line.clear();
        bytes += header.read_until(end, &mut line).map_err(io)? as u64;
        lines += 1;
        at_most("bytes of header", bytes, MAX_HDR_HEADER_BYTES)?;
        at_most("lines of header", lines, MAX_HDR_HEADER_LINES as u64)?;
        if line.last() != Some(&end) {
            break;
        }
        if line.trim_ascii().is_empty() {
            line.clear();
            header.read_until(end, &mut line).map_err(io)?;
            size = resolution(&String::from_utf8_lossy(&line));
            break;
        }
    }
    file.rewind().map_err(io)?;
    Ok(size)
}

/// "-Y 512 +X 1024"
fn resolution(line: &str) -> Size {
    let words: Vec<_> = line.split_whitespace().collect();
    let [_, first, _, second] = words[..] else { return None };
    let [first, second] = [first, second].map(|n| n.parse::<u64>().ok());
    Some([second?, first?])
}
