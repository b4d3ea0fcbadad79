//! JPEG (ITU-T T.81): a walk over its markers, through entropy-coded data too.

use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use super::{Size, next};
use crate::limits::{MAX_METADATA_BYTES, MAX_METADATA_PIECES, MAX_SCANS, at_most};
use crate::{Error, Result};

pub(super) fn check(file: &mut (impl Read + Seek), path: &Path) -> Result<Size> {
    let mut file = BufReader::with_capacity(1 << 16, file);
    walk(&mut file).map_err(|e| Error::io(path, "read", e))?
}

fn walk(file: &mut (impl BufRead + Seek)) -> std::io::Result<Result<Size>> {
    let mut size = None;
    let (mut pieces, mut metadata, mut scans) = (0, 0, 0);
    while let Some(marker) = marker(file)? {
        match marker {
            // those without a length: end, start, restarts, a private one
            0xD9 if scans > 0 => break,
            0x01 | 0xD0..=0xD9 => continue,
            _ => {}
        }
        let Some(length) = next::<2>(file)?.map(u16::from_be_bytes) else { break };
        let mut body = u64::from(length).saturating_sub(2);
        match marker {
            0xDA => scans += 1,
            // frame headers; not the tables C4 and CC, nor C8
            0xC0..=0xC3 | 0xC5..=0xC7 | 0xC9..=0xCB | 0xCD..=0xCF if body >= 5 => {
                let Some([_, a, b, c, d]) = next::<5>(file)? else { break };
                let found = [[c, d], [a, b]].map(|n| u64::from(u16::from_be_bytes(n)));
                if size.replace(found).is_some_and(|first| first != found) {
                    return Ok(Err(Error::invalid("damaged JPEG file: two frames of different sizes")));
                }
                body -= 5;
            }
            0xE0..=0xEF | 0xFE => (pieces, metadata) = (pieces + 1, metadata + body),
            _ => {}
        }
        let checked = at_most("scans", scans, MAX_SCANS as u64)
            .and_then(|()| at_most("bytes of metadata", metadata, MAX_METADATA_BYTES))
            .and_then(|()| at_most("segments of metadata", pieces, MAX_METADATA_PIECES as u64));
        if let Err(error) = checked {
            return Ok(Err(error));
        }
        file.seek_relative(body as i64)?;
    }
    Ok(Ok(size))
}

/// The next marker, stepping over what is none: stuffed and coded bytes.
fn marker(file: &mut impl BufRead) -> std::io::Result<Option<u8>> {
    loop {
        if file.skip_until(0xFF)? == 0 {
            return Ok(None);
        }
        loop {
            match next::<1>(file)? {
                None => return Ok(None),
                // fill bytes
                Some([0xFF]) => {}
                // a byte of coded data
                Some([0]) => break,
                Some([marker]) => return Ok(Some(marker)),
            }
        }
    }
}
