//! JPEG (ITU-T T.81): a walk over its markers, through entropy-coded data too.
//!
//! What is valid but not read is named here: the decoder calls some of it damaged, and decodes some of it wrongly
//! (docs/UPSTREAM.md).

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
            // frame headers, that of JPEG-LS too; not the tables C4 and CC, nor C8
            0xC0..=0xC3 | 0xC5..=0xC7 | 0xC9..=0xCB | 0xCD..=0xCF | 0xF7 if body >= 6 => {
                let Some([bits, a, b, c, d, count]) = next::<6>(file)? else { break };
                let found = [[c, d], [a, b]].map(|n| u64::from(u16::from_be_bytes(n)));
                if size.replace(found).is_some_and(|first| first != found) {
                    return Ok(Err(Error::invalid("damaged JPEG file: two frames of different sizes")));
                }
                body -= 6;
                let mut factors = Vec::new();
                for _ in 0..u64::from(count).min(body / 3) {
                    let Some([_, factor, _]) = next::<3>(file)? else { break };
                    factors.push([factor >> 4, factor & 15]);
                    body -= 3;
                }
                if let Err(error) = coding(marker, bits).and_then(|()| sampling(&factors)) {
                    return Ok(Err(error));
                }
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

/// Which frames are read: sequential and progressive, by Huffman's code, of 8 bits.
fn coding(marker: u8, bits: u8) -> Result<()> {
    let found = match marker {
        0xF7 => "is JPEG-LS".to_owned(),
        0xC3 | 0xCB => "is coded without loss".to_owned(),
        0xC5..=0xC7 | 0xCD..=0xCF => "is coded in a hierarchy of frames".to_owned(),
        0xC9 | 0xCA => "is coded arithmetically".to_owned(),
        _ if bits != 8 => format!("has {bits} bits to a sample"),
        _ => return Ok(()),
    };
    Err(Error::unsupported(format!(
        "{found}; of JPEG only sequential and progressive Huffman coding of 8 bits is read"
    )))
}

/// Which relations of the components' sampling factors are read. That of a single component means nothing.
fn sampling(factors: &[[u8; 2]]) -> Result<()> {
    let across = |factor: &[u8; 2]| [1, 2, 4].contains(&factor[0]);
    let largest = factors.iter().fold([1; 2], |[h, v], factor| [h.max(factor[0]), v.max(factor[1])]);
    // one below the largest is 1; what is 0 the decoder refuses
    let down = |factor: &[u8; 2]| factor[1] == largest[1] || factor[1] < 2;
    let whole = factors.first().is_none_or(|first| first[0] == largest[0]);
    if factors.iter().all(across) && (factors.len() == 1 || factors.iter().all(down) && whole) {
        return Ok(());
    }
    let list = factors.iter().map(|[h, v]| format!("{h}x{v}")).collect::<Vec<_>>().join(", ");
    Err(Error::unsupported(format!(
        "is a JPEG whose components have the sampling factors {list}; only 1, 2 and 4 across are read, with the first component's the largest"
    )))
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
