//! What the text chunks of a PNG carry that is no text: XMP, and the profiles that ImageMagick writes as hexadecimal digits
//! (`Raw profile type exif`).

use miniz_oxide::inflate::{TINFLStatus, decompress_to_vec_zlib_with_limit};

use crate::Result;
use crate::limits::{MAX_METADATA_BYTES, at_most};

/// The keyword of XMP (ISO 16684-3).
const XMP: &str = "XML:com.adobe.xmp";
/// How the keywords of ImageMagick's profiles begin.
const RAW: &str = "Raw profile type ";
/// What stands before a packet in JPEG, and so in a profile called APP1.
const JPEG_XMP: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";

/// What a text chunk carries.
#[derive(Debug, PartialEq)]
pub(super) enum Carried {
    Exif(Vec<u8>),
    Xmp(Vec<u8>),
    /// It cannot be unpacked.
    Damaged,
}

/// The keyword of a text chunk that carries any of these.
pub(super) fn keyword(body: &[u8]) -> Option<&str> {
    let end = body.iter().take(80).position(|b| *b == 0)?;
    let keyword = std::str::from_utf8(&body[..end]).ok()?;
    let raw = |kind: &str| ["exif", "app1", "xmp"].iter().any(|k| k.eq_ignore_ascii_case(kind));
    Some(keyword).filter(|k| *k == XMP || k.strip_prefix(RAW).is_some_and(raw))
}

/// What the chunk `name` with this [keyword] carries. `unpacked` counts the bytes of a whole file.
///
/// # Errors
/// [`Error::TooLarge`](crate::Error::TooLarge) beyond [`MAX_METADATA_BYTES`] of unpacked data.
pub(super) fn carried(name: &[u8; 4], keyword: &str, body: &[u8], unpacked: &mut u64) -> Result<Carried> {
    let damaged = Ok(Carried::Damaged);
    let Some((packed, content)) = content(name, &body[keyword.len() + 1..]) else { return damaged };
    let left = MAX_METADATA_BYTES.saturating_sub(*unpacked);
    let text = if packed {
        match decompress_to_vec_zlib_with_limit(content, left as usize) {
            Ok(text) => text,
            Err(e) if e.status == TINFLStatus::HasMoreOutput => {
                *unpacked += left + 1;
                Vec::new()
            }
            Err(_) => return damaged,
        }
    } else {
        content.to_vec()
    };
    *unpacked += text.len() as u64;
    at_most("bytes of unpacked metadata", *unpacked, MAX_METADATA_BYTES)?;
    let Some(kind) = keyword.strip_prefix(RAW) else { return Ok(Carried::Xmp(text)) };
    let Some(profile) = profile(&text) else { return damaged };
    Ok(if let Some(packet) = profile.strip_prefix(JPEG_XMP) {
        Carried::Xmp(packet.to_vec())
    } else if kind.eq_ignore_ascii_case("xmp") {
        Carried::Xmp(profile)
    } else {
        Carried::Exif(profile)
    })
}

/// Whether what stands behind the keyword is packed, and where it begins (PNG, third edition, 11.3.3).
fn content<'a>(name: &[u8; 4], rest: &'a [u8]) -> Option<(bool, &'a [u8])> {
    match name {
        b"tEXt" => Some((false, rest)),
        b"zTXt" => Some((true, rest.get(1..)?)),
        _ => {
            let (&[packed, _method], rest) = rest.split_first_chunk()?;
            let mut parts = rest.splitn(3, |b| *b == 0);
            let (_language, _translated) = (parts.next()?, parts.next()?);
            Some((packed != 0, parts.next()?))
        }
    }
}

/// Bytes from lines: the profile's name, how many bytes there are, and two digits for each.
fn profile(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.trim_ascii_start();
    let line = |text: &[u8]| text.iter().position(|b| *b == b'\n');
    let text = text[line(text)? + 1..].trim_ascii_start();
    let (count, digits) = text.split_at(line(text)?);
    let count: usize = std::str::from_utf8(count).ok()?.trim().parse().ok()?;
    let mut digits = digits.iter().filter(|b| !b.is_ascii_whitespace()).map(|b| (*b as char).to_digit(16));
    let mut bytes = Vec::new();
    while let Some(high) = digits.next().filter(|_| bytes.len() < count) {
        bytes.push((high? << 4 | digits.next()??) as u8);
    }
    (bytes.len() == count).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_are_names_counts_and_digits() {
        assert_eq!(profile(b"\nexif\n       3\n0aFf\n80\n"), Some(vec![10, 255, 128]));
        for wrong in [&b"\nexif\n       3\n0aff\n"[..], b"exif", b"\nexif\n2\n0ag0\n", b"\nexif\nx\n00\n"] {
            assert_eq!(profile(wrong), None, "{:?}", String::from_utf8_lossy(wrong));
        }
    }

    #[test]
    fn unpacked_bytes_are_counted() {
        let packed = |count: usize| {
            let text = miniz_oxide::deflate::compress_to_vec_zlib(&vec![b' '; count], 1);
            [b"XML:com.adobe.xmp\0\x01\0\0\0".as_slice(), &text].concat()
        };
        let all = MAX_METADATA_BYTES as usize;
        let mut unpacked = 0;
        let mut carried = |count| super::carried(b"iTXt", XMP, &packed(count), &mut unpacked);
        assert!(carried(all - 9).is_ok());
        assert!(carried(9).is_ok());
        let error = carried(1).unwrap_err().to_string();
        assert!(error.contains("unpacked metadata") && error.contains("limit"), "{error}");
    }
}
