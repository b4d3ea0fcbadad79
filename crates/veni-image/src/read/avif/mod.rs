//! AVIF (feature `avif`): boxes by avif-parse, the AV1 frame by rav1d, from there to display values.
//!
//! Boxes: ISO/IEC 14496-12 and 23008-12. Colour code points and Y′CbCr: ITU-T H.273; what an `nclx` box says goes before what
//! the AV1 stream says, and an unspecified matrix is that of BT.601.

mod boxes;
mod frame;
mod sequence;
#[cfg(test)]
mod tests;

use std::io::Read;
use std::path::Path;

use avif_parse::AvifData;

use super::meaning::Meaning;
use super::spaces::h273;
use super::{LdrPanorama, ReadOptions, icc, precheck};
use crate::limits::{MAX_FILE_BYTES, at_most};
use crate::{Error, Result};
use frame::Frame;
use sequence::Sequence;

/// Code points of H.273 for what display values mean.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Coding {
    primaries: u8,
    transfer: u8,
    matrix: u8,
    full_range: bool,
}

/// All bytes of the file, within the limit.
fn content(file: impl Read, path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, "read", e))?;
    at_most("bytes of file", bytes.len() as u64, MAX_FILE_BYTES)?;
    Ok(bytes)
}

fn parse(mut bytes: &[u8]) -> Result<AvifData> {
    boxes::check(bytes)?;
    AvifData::from_reader(&mut bytes).map_err(wrap)
}

/// The size that the picture's stream declares.
pub(super) fn declared(file: impl Read, path: &Path) -> Result<[u64; 2]> {
    let data = parse(&content(file, path)?)?;
    Ok(Sequence::of(&data.primary_item)?.size)
}

pub(super) fn read(file: impl Read, path: &Path, options: &ReadOptions) -> Result<LdrPanorama> {
    let bytes = content(file, path)?;
    let data = parse(&bytes)?;
    let sequence = Sequence::of(&data.primary_item)?;
    let size = sequence.size.map(|n| n as usize);
    let grid = options.check(size[0], size[1])?;
    precheck::budget(Some(sequence.size), options)?;
    let properties = properties(&bytes);
    refuse_transformed(properties)?;

    let limit = u32::try_from(options.max_pixels).unwrap_or(u32::MAX);
    let coding = nclx(properties).unwrap_or(sequence.coding);
    let meaning = meaning(properties, coding, options)?;
    let colour = Frame::decode(&data.primary_item, limit)?;
    if colour.size() != size {
        return Err(Error::invalid("damaged AVIF file: the picture is not as large as its header says"));
    }
    let mut panorama = LdrPanorama { meaning, ..LdrPanorama::new(grid, colour.rgb(coding)?) };
    if let Some(alpha) = &data.alpha_item {
        let Sequence { size: claimed, coding } = Sequence::of(alpha)?;
        if claimed != sequence.size {
            return Err(Error::invalid("damaged AVIF file: its alpha is not as large as the picture"));
        }
        let alpha = Frame::decode(alpha, limit)?;
        if alpha.size() != size {
            return Err(Error::invalid("damaged AVIF file: its alpha is not as large as the picture"));
        }
        let known = alpha.opacity(coding.full_range);
        if data.premultiplied_alpha {
            let pixels = panorama.values.iter_mut().zip(&known).filter(|(_, known)| **known > 0.0);
            pixels.for_each(|(pixel, known)| *pixel = pixel.map(|v| (v / known).min(1.0)));
        }
        panorama.known = Some(known).filter(|known| known.iter().any(|k| *k < 1.0));
    }
    Ok(panorama)
}

fn wrap(error: avif_parse::Error) -> Error {
    match error {
        avif_parse::Error::Unsupported(what) => {
            Error::unsupported(format!("AVIF: {what}; convert it to PNG first"))
        }
        other => Error::invalid(format!("damaged or truncated AVIF file: {other}")),
    }
}

/// The `meta` box, which holds all properties; nothing where there is none.
fn properties(mut bytes: &[u8]) -> &[u8] {
    while let Some((&[a, b, c, d, ref name @ ..], _)) = bytes.split_first_chunk::<8>() {
        let size = u32::from_be_bytes([a, b, c, d]) as usize;
        // 0: up to the end; 1: a size of 64 bits follows, which no box before or at `meta` needs
        let size = if size == 0 { bytes.len() } else { size.max(8) };
        if name == b"meta" {
            return &bytes[8..size.min(bytes.len())];
        }
        bytes = bytes.get(size..).unwrap_or_default();
    }
    &[]
}

/// What follows a property's name.
fn after<'a>(properties: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    let at = properties.windows(name.len()).position(|window| window == name)?;
    Some(&properties[at + name.len()..])
}

fn nclx(properties: &[u8]) -> Option<Coding> {
    let &[_, primaries, _, transfer, _, matrix, range] = after(properties, b"colrnclx")?.first_chunk()?;
    Some(Coding { primaries, transfer, matrix, full_range: range & 0x80 != 0 })
}

fn refuse_transformed(properties: &[u8]) -> Result<()> {
    let turned = after(properties, b"irot").and_then(<[u8]>::first).is_some_and(|turns| turns & 3 != 0);
    let named = [(turned, "turned"), (after(properties, b"imir").is_some(), "mirrored")];
    let cut = (after(properties, b"clap").is_some(), "cut");
    match named.into_iter().chain([cut]).find(|(there, _)| *there) {
        Some((_, how)) => Err(Error::unsupported(format!(
            "AVIF that is to be {how} before it is shown is not read; save it as it is shown, or as PNG"
        ))),
        None => Ok(()),
    }
}

/// A profile goes before code points, of which only matrix and range then count (MIAF, 7.3.6.4).
fn meaning(properties: &[u8], coding: Coding, options: &ReadOptions) -> Result<Meaning> {
    if options.data {
        return Ok(Meaning::default());
    }
    let profile = [b"colrprof".as_slice(), b"colrrICC"].into_iter().find_map(|name| {
        let at = properties.windows(name.len()).position(|window| window == name)?;
        let length = u32::from_be_bytes(*properties.get(at.checked_sub(4)?..)?.first_chunk()?) as usize;
        properties.get(at + name.len()..(at - 4).checked_add(length)?)
    });
    match profile {
        Some(profile) => icc::meaning(profile),
        None => h273(coding.primaries, coding.transfer, "AVIF"),
    }
}
