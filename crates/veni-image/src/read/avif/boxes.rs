//! Sizes and counts that boxes claim, checked before the parser allocates for them (docs/UPSTREAM.md).

use crate::{Error, Result};

/// Boxes whose content the parser reads as a whole, or by a count.
const READ: [&[u8; 4]; 5] = [b"ftyp", b"meta", b"mdat", b"iinf", b"iloc"];
/// The fewest bytes of an entry of `iinf` and of `iloc`.
const ENTRY: usize = 6;

/// Checks all boxes of a file, and those in its `meta` box.
///
/// # Errors
/// [`Error::Invalid`] naming the box that claims more than there is.
pub(super) fn check(bytes: &[u8]) -> Result<()> {
    each(bytes, |name, content| match name {
        // of version and flags, then boxes
        b"meta" => each(content.get(4..).unwrap_or_default(), |name, content| match name {
            b"iinf" => count(name, content, if content.first() == Some(&0) { 2 } else { 4 }, 4),
            b"iloc" => count(name, content, if content.first() < Some(&2) { 2 } else { 4 }, 6),
            _ => Ok(()),
        }),
        _ => Ok(()),
    })
}

/// Calls `visit` with the name and the content of one box after the other.
fn each(mut bytes: &[u8], mut visit: impl FnMut(&[u8; 4], &[u8]) -> Result<()>) -> Result<()> {
    while let Some((&[a, b, c, d, ref name @ ..], _)) = bytes.split_first_chunk::<8>() {
        let (size, header) = match u32::from_be_bytes([a, b, c, d]) {
            // up to the end
            0 => (bytes.len() as u64, 8),
            // a size of 64 bits follows
            1 => match bytes[8..].first_chunk() {
                Some(size) => (u64::from_be_bytes(*size), 16),
                None => return Ok(()),
            },
            size => (u64::from(size), 8),
        };
        let there = bytes.len();
        let Some(size) = usize::try_from(size).ok().filter(|size| (header..=there).contains(size)) else {
            // of what is only skipped, and of bytes behind the last box, nothing is allocated
            return if READ.contains(&name) { Err(claims(name, size, there)) } else { Ok(()) };
        };
        visit(name, &bytes[header..size])?;
        bytes = &bytes[size..];
    }
    Ok(())
}

/// Checks the number of entries, in `width` bytes at `at`.
fn count(name: &[u8; 4], content: &[u8], width: usize, at: usize) -> Result<()> {
    let Some(digits) = content.get(at..at + width) else { return Ok(()) };
    let entries = digits.iter().fold(0, |sum, byte| sum << 8 | u64::from(*byte));
    if entries > (content.len() / ENTRY) as u64 {
        return Err(claims(name, entries.saturating_mul(ENTRY as u64), content.len()));
    }
    Ok(())
}

fn claims(name: &[u8; 4], bytes: u64, there: usize) -> Error {
    Error::invalid(format!(
        "damaged or truncated AVIF file: its box '{}' claims {bytes} bytes, {there} are there",
        name.escape_ascii()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn a_box(name: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32 + 8).to_be_bytes()[..], name, content].concat()
    }

    #[test]
    fn what_is_there_may_be_claimed() {
        let iinf = a_box(b"iinf", &[0, 0, 0, 0, 0, 1, 0, 0, 0, 8, b'x', b'x', b'x', b'x']);
        let meta = a_box(b"meta", &[&[0; 4][..], &iinf].concat());
        let mut file = [a_box(b"ftyp", b"avif0000"), meta, a_box(b"mdat", b"pixels")].concat();
        check(&file).unwrap();
        // bytes behind the last box are no box
        file.extend(b"\x7F\0\0\0junkjunk");
        check(&file).unwrap();
        // a large size, and one up to the end
        check(&[&1u32.to_be_bytes()[..], b"mdat", &20u64.to_be_bytes(), b"four"].concat()).unwrap();
        check(b"\0\0\0\0mdatpixels").unwrap();
    }

    #[test]
    fn more_than_is_there_is_refused_by_name() {
        let refused = |file: &[u8], name: &str| {
            let message = check(file).unwrap_err().to_string();
            assert!(message.contains(name) && message.contains("claims"), "{message}");
        };
        refused(b"\\?R0ftypavifls", "ftyp");
        refused(&[&1u32.to_be_bytes()[..], b"mdat", &u64::MAX.to_be_bytes(), b"four"].concat(), "mdat");
        let inside = |entries: &[u8]| a_box(b"meta", &[&[0; 4][..], entries].concat());
        refused(&inside(&a_box(b"iinf", &[1, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF])), "iinf");
        refused(&inside(&a_box(b"iloc", &[2, 0, 0, 0, 0x44, 0, 0x7F, 0xFF, 0xFF, 0xFF])), "iloc");
        refused(&inside(b"\x7F\0\0\0iloc"), "iloc");
    }
}
