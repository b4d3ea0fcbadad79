//! Whether a JPEG has all of its picture (ITU-T T.81): a walk over its entropy-coded data, block by block, without decoding any
//! value.
//!
//! The decoder paints what is missing grey and says nothing (docs/UPSTREAM.md). An end marker proves nothing: programs add one
//! to what they have of a download, and a picture of several scans may lack the later ones.

mod bits;
mod blocks;
mod header;
mod huffman;

use self::bits::Bits;
use self::blocks::Band;
use self::header::{Component, Frame, Scan, Tables};
use self::huffman::Huffman;
use crate::limits::{MAX_SCANS, at_most};
use crate::{Error, Result};

/// Bytes behind the last block that encoders are known to leave are a few; more than this, and than a part in
/// [`PADDING`], are of blocks that were misread.
const UNUSED: usize = 64;
/// Of the bytes of a scan.
const PADDING: usize = 16;

/// Walks over the first picture of a file. What the decoder refuses is left to it.
///
/// # Errors
/// [`Error::Invalid`] where data end, or are no code, before all blocks are there, or where bits of coefficients are missing
/// at the end.
pub(in crate::read) fn complete(bytes: &[u8]) -> Result<()> {
    let (mut tables, mut frame, mut interval, mut scans) = (Tables::default(), None, 0, 0);
    let mut at = 2;
    while let Some((marker, behind)) = marker(bytes, at) {
        at = behind;
        if matches!(marker, 0x01 | 0xD0..=0xD8) {
            continue;
        }
        let Some(content) = segment(bytes, at).filter(|_| marker != 0xD9) else { break };
        at += 2 + content.len();
        match (marker, &mut frame) {
            // tables that everybody knows are left out
            (0xE0, _) if content.starts_with(b"AVI1") => return Ok(()),
            (0xC0..=0xC2, None) => match Frame::new(marker, content) {
                None => return Ok(()),
                new => frame = new,
            },
            (0xC4, _) => tables.define(content),
            (0xDD, _) => interval = content.first_chunk().map_or(0, |n| u16::from_be_bytes(*n)),
            (0xDA, Some(frame)) => {
                scans += 1;
                at_most("scans", scans, MAX_SCANS as u64)?;
                let scan = Scan::new(frame, content).ok_or_else(|| {
                    Error::invalid(format!(
                        "damaged or truncated JPEG file: the header of scan {scans} is none"
                    ))
                })?;
                at = walk(bytes, at, &scan, frame, &tables, usize::from(interval))?;
            }
            _ => {}
        }
    }
    frame.map_or(Ok(()), |frame| all_sent(&frame))
}

/// The next marker and where it ends.
fn marker(bytes: &[u8], mut at: usize) -> Option<(u8, usize)> {
    loop {
        at += bytes.get(at..)?.iter().position(|b| *b == 0xFF)? + 1;
        match *bytes.get(at)? {
            0 | 0xFF => {}
            marker => return Some((marker, at + 1)),
        }
    }
}

/// What stands behind a segment's length.
fn segment(bytes: &[u8], at: usize) -> Option<&[u8]> {
    let length = u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?);
    bytes.get(at + 2..at + usize::from(length))
}

/// Every bit of every coefficient was in a scan.
fn all_sent(frame: &Frame) -> Result<()> {
    for (number, component) in (1..).zip(&frame.components) {
        if component.sent.iter().all(Option::is_none) {
            return Err(Error::invalid(format!("truncated JPEG file: no scan holds its component {number}")));
        }
        if let Some(k) = component.sent.iter().position(|low| *low != Some(0)) {
            return Err(Error::invalid(format!(
                "truncated JPEG file: its scans end before the last bits of coefficient {k} of component {number}"
            )));
        }
    }
    Ok(())
}

/// One scan from `start`; where the marker behind it begins.
fn walk(
    bytes: &[u8],
    start: usize,
    scan: &Scan,
    frame: &mut Frame,
    tables: &Tables,
    interval: usize,
) -> Result<usize> {
    let alone = scan.parts.len() == 1;
    let [across, down] = if alone { frame.components[scan.parts[0].0].blocks } else { frame.units };
    let total = across * down;
    let mut unit = Unit::new(scan, frame, tables)?;
    let (mut bits, mut run, mut unused) = (Bits::new(bytes, start), 0, 0);
    for done in 0..total {
        let ended = || {
            Error::invalid(format!(
                "truncated JPEG file: its picture data end after {done} of {total} blocks"
            ))
        };
        if interval > 0 && done > 0 && done % interval == 0 {
            let (at, left) = bits.end();
            unused += left;
            let due = ((done / interval - 1) % 8) as u8;
            match marker(bytes, at) {
                Some((found, behind)) if found == 0xD0 + due => (bits, run) = (Bits::new(bytes, behind), 0),
                Some((found @ 0xD0..=0xD7, _)) => {
                    return Err(Error::invalid(format!(
                        "damaged JPEG file: restart marker {} stands where {due} is due, after {done} of {total} blocks",
                        found - 0xD0
                    )));
                }
                _ => return Err(ended()),
            }
        }
        let stepped = unit.step(&mut bits, [done % across, done / across], &mut run);
        if bits.is_short() {
            return Err(ended());
        }
        if stepped.is_none() {
            return Err(Error::invalid(format!(
                "damaged JPEG file: its picture data are no code after {done} of {total} blocks"
            )));
        }
    }
    let (at, left) = bits.end();
    unused += left;
    if unused > UNUSED && unused > (at - start) / PADDING {
        return Err(Error::invalid(format!(
            "damaged JPEG file: its picture data go on for {unused} bytes behind the last of {total} blocks"
        )));
    }
    Ok(at)
}

/// What is between two counts of a scan: the blocks of all its components, or one of its only one.
enum Unit<'a> {
    /// Of each component how many blocks, and their tables.
    Sequential(Vec<(usize, &'a Huffman, &'a Huffman)>),
    /// The lowest coefficients, for which other blocks need not be known.
    Lowest(Band, Vec<(usize, Option<&'a Huffman>)>),
    Band(Band, &'a Huffman, &'a mut Component),
}

impl<'a> Unit<'a> {
    /// Notes in the frame what the scan sends.
    fn new(scan: &Scan, frame: &'a mut Frame, tables: &'a Tables) -> Result<Self> {
        let [first, last] = scan.band;
        for (place, _) in &scan.parts {
            let sent = &mut frame.components[*place].sent[usize::from(first)..=usize::from(last)];
            sent.fill(Some(scan.low));
        }
        let missing = || Error::invalid("damaged JPEG file: a scan names a Huffman table that is not there");
        let table = |class: &'a [Option<Huffman>; 4], place: usize| {
            class.get(place).and_then(Option::as_ref).ok_or_else(missing)
        };
        let blocks = |frame: &Frame, place: usize| match scan.parts[..] {
            [_] => 1,
            _ => frame.components[place].sampling.iter().product(),
        };
        if !frame.progressive {
            let part = |&(place, [dc, ac]): &(usize, [usize; 2])| {
                Ok((blocks(frame, place), table(&tables.dc, dc)?, table(&tables.ac, ac)?))
            };
            return scan.parts.iter().map(part).collect::<Result<_>>().map(Self::Sequential);
        }
        let band = Band { first: first.into(), last: last.into(), refines: scan.high > 0 };
        if first == 0 {
            let part = |&(place, [dc, _]): &(usize, [usize; 2])| {
                let table = if band.refines { None } else { Some(table(&tables.dc, dc)?) };
                Ok((blocks(frame, place), table))
            };
            let parts = scan.parts.iter().map(part).collect::<Result<_>>()?;
            return Ok(Self::Lowest(band, parts));
        }
        let (place, [_, ac]) = scan.parts[0];
        Ok(Self::Band(band, table(&tables.ac, ac)?, &mut frame.components[place]))
    }

    /// Steps over one; nothing where a code is none.
    fn step(&mut self, bits: &mut Bits<'_>, [x, y]: [usize; 2], run: &mut u32) -> Option<()> {
        match self {
            Self::Sequential(parts) => {
                for (count, dc, ac) in parts {
                    for _ in 0..*count {
                        blocks::sequential(bits, dc, ac)?;
                    }
                }
            }
            Self::Lowest(band, parts) => {
                for (count, table) in parts {
                    for _ in 0..*count {
                        band.lowest(bits, *table)?;
                    }
                }
            }
            Self::Band(band, table, component) => {
                let known = component.known.get_mut(y * component.stride + x)?;
                band.others(bits, table, known, run)?;
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests;
