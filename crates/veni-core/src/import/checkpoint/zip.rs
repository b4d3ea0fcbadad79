//! The zip archive around a PyTorch file: PyTorch stores its entries uncompressed, so an entry is a range of bytes.

use std::collections::BTreeMap;
use std::ops::Range;

use super::bytes::{at, u16_at, u32_at};
use crate::{Error, Result};

const END: [u8; 4] = *b"PK\x05\x06";
const CENTRAL: [u8; 4] = *b"PK\x01\x02";
const LOCAL: [u8; 4] = *b"PK\x03\x04";
/// Length of the end record without its comment, and of the longest comment.
const END_BYTES: usize = 22;
const MAX_COMMENT: usize = 65_535;

/// Where each entry's bytes are, by name without the archive's own folder (`archive/data.pkl` is `data.pkl`).
///
/// # Errors
/// [`Error::Invalid`] for a truncated or damaged archive, [`Error::Unsupported`] for a compressed entry.
pub(super) fn entries(file: &[u8]) -> Result<BTreeMap<String, Range<usize>>> {
    let first = file.len().saturating_sub(END_BYTES + MAX_COMMENT);
    let end =
        (first..(file.len() + 1).saturating_sub(END_BYTES)).rev().find(|&p| file[p..].starts_with(&END));
    let end = end.ok_or_else(|| Error::invalid("the zip archive is truncated (no directory at its end)"))?;
    let (count, mut position) = (u16_at(file, end + 10)?, u32_at(file, end + 16)?);
    if count == usize::from(u16::MAX) || position == u32::MAX as usize {
        return Err(Error::unsupported("a zip64 archive: convert the weights to safetensors"));
    }
    let mut entries = BTreeMap::new();
    for _ in 0..count {
        let damaged = || Error::invalid("the zip archive's directory is damaged");
        if at(file, position, 4)? != CENTRAL {
            return Err(damaged());
        }
        let (method, packed, size) =
            (u16_at(file, position + 10)?, u32_at(file, position + 20)?, u32_at(file, position + 24)?);
        let (name, extra, comment) =
            (u16_at(file, position + 28)?, u16_at(file, position + 30)?, u16_at(file, position + 32)?);
        let local = u32_at(file, position + 42)?;
        let name_text = String::from_utf8_lossy(at(file, position + 46, name)?).into_owned();
        if method != 0 || packed != size {
            return Err(Error::unsupported(format!(
                "entry {name_text} of the zip archive is compressed, which PyTorch never does: save the file with \
                 torch.save, or convert it to safetensors"
            )));
        }
        if at(file, local, 4)? != LOCAL {
            return Err(damaged());
        }
        let start = local + 30 + u16_at(file, local + 26)? + u16_at(file, local + 28)?;
        at(file, start, size)?;
        let inner = name_text.split_once('/').map_or(name_text.as_str(), |(_, rest)| rest);
        entries.insert(inner.to_owned(), start..start + size);
        position += 46 + name + extra + comment;
    }
    Ok(entries)
}
