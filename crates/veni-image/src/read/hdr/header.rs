//! The lines before the pixels: `NAME=value`, comments, an empty line, the resolution.

use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::path::Path;

use super::rows::Layout;
use super::wrap;
use crate::{Error, Result};

/// Bytes of a header, and of one of its lines; histories of commands take some thousands, a latent of dimension 300 4,000.
const LARGEST: u64 = 1 << 24;

/// What the header says.
#[derive(Debug)]
pub(super) struct Header {
    /// In their order, names as they are written.
    lines: Vec<(String, String)>,
    pub(super) layout: Layout,
    pub(super) is_xyz: bool,
}

impl Header {
    /// Reads up to the first pixel.
    pub(super) fn read(file: &mut impl BufRead, path: &Path) -> Result<Self> {
        let end = line_end(file.fill_buf().map_err(|e| wrap(e, path))?);
        let mut rest = file.take(LARGEST);
        let mut lines = Vec::new();
        let mut is_xyz = false;
        let mut first = true;
        loop {
            let line = line(&mut rest, end, path)?.ok_or_else(|| match rest.limit() {
                0 => Error::too_large(format!("a Radiance header of more than {LARGEST} bytes")),
                _ => Error::invalid("truncated Radiance .hdr file: its header does not end"),
            })?;
            if line.is_empty() && !first {
                break;
            }
            // lines without '=' are the commands that made the picture; what is indented was said of another picture, of which this
            // one was made (Radiance's pcomb, pcompos)
            if let Some((name, value)) = line.split_once('=').filter(|_| !line.starts_with(['#', ' ', '\t']))
            {
                if name.trim() == "FORMAT" {
                    is_xyz = match value.trim() {
                        "32-bit_rle_rgbe" => false,
                        "32-bit_rle_xyze" => true,
                        other => {
                            return Err(Error::unsupported(format!(
                                "Radiance .hdr with FORMAT={other} is not read"
                            )));
                        }
                    };
                }
                lines.push((name.to_owned(), value.to_owned()));
            }
            first = false;
        }
        let resolution = line(&mut rest, end, path)?;
        let resolution =
            resolution.ok_or_else(|| Error::invalid("truncated Radiance .hdr file: no resolution"))?;
        let layout = Layout::parse(&resolution).ok_or_else(|| {
            Error::invalid(format!(
                "damaged Radiance .hdr file: {resolution:?} is not a resolution like -Y 512 +X 1024"
            ))
        })?;
        Ok(Self { lines, layout, is_xyz })
    }

    /// Width and height of the picture, upright.
    pub(super) fn size(&self) -> [usize; 2] {
        self.layout.size()
    }

    /// Every value of a name.
    pub(super) fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a str> {
        self.lines.iter().filter(move |(n, _)| n.trim() == name).map(|(_, value)| value.as_str())
    }

    pub(super) fn attributes(&self) -> BTreeMap<String, String> {
        crate::numbered::join(self.lines.iter().filter(|(name, _)| !name.is_empty()).cloned().collect())
    }
}

/// The last byte of every line: LF, or CR where the first line ends in one alone.
pub(in crate::read) fn line_end(start: &[u8]) -> u8 {
    let first = start.iter().position(|b| matches!(b, b'\r' | b'\n'));
    match first.map(|at| &start[at..]) {
        Some([b'\r', next, ..]) if *next != b'\n' => b'\r',
        _ => b'\n',
    }
}

/// One line without its end, which is `end`, or CR LF where that is LF; nothing at the end of the file.
fn line(file: &mut impl BufRead, end: u8, path: &Path) -> Result<Option<String>> {
    let mut bytes = Vec::new();
    file.read_until(end, &mut bytes).map_err(|e| wrap(e, path))?;
    if bytes.pop() != Some(end) {
        return Ok(None);
    }
    if bytes.last() == Some(&b'\r') {
        bytes.pop();
    }
    Ok(Some(String::from_utf8_lossy(&bytes).into_owned()))
}
