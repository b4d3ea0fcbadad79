//! The segments of a JPEG file (ITU-T T.81), and the pictures behind the first.

mod packets;
mod scan;

pub(super) use self::packets::packets;
pub(super) use self::scan::complete;
use super::display::Tags;

/// Markers with their content and where they begin, the first scan the last; any number of fill bytes may stand before each.
fn walk(bytes: &[u8]) -> impl Iterator<Item = (usize, u8, &[u8])> {
    let mut next = Some(2);
    std::iter::from_fn(move || {
        let mut at = next?;
        while bytes.get(at..at + 2)? == [0xFF; 2] {
            at += 1;
        }
        let &[0xFF, marker, high, low] = bytes.get(at..at + 4)? else { return None };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let content = bytes.get(at + 4..at + 2 + length)?;
        next = (marker != 0xDA).then_some(at + 2 + length);
        Some((at, marker, content))
    })
}

/// Markers with their content, up to the first scan.
pub(super) fn segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    walk(bytes).map(|(_, marker, content)| (marker, content)).filter(|(marker, _)| *marker != 0xDA)
}

/// Where the first scan begins; nothing where there is none, which the decoder says.
fn scan(bytes: &[u8]) -> Option<usize> {
    walk(bytes).find_map(|(at, marker, _)| (marker == 0xDA).then_some(at))
}

fn find(bytes: &[u8], from: usize, name: &[u8]) -> Option<usize> {
    bytes.get(from..)?.windows(name.len()).position(|window| window == name).map(|at| from + at)
}

/// Whether there is an end marker behind the start of its first scan; the decoder paints what is missing grey. Segments before
/// the scan are stepped over: thumbnails in them have an end of their own.
pub(super) fn ends(bytes: &[u8]) -> bool {
    scan(bytes).is_none_or(|scan| find(bytes, scan, &[0xFF, 0xD9]).is_some())
}

/// Whatever begins like a picture behind the end of the first (CIPA DC-007 puts them there). What lies in the segments of one is
/// not looked at as another: a thumbnail is no picture of the file, and each byte is walked over once.
pub(super) fn others(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut from = scan(bytes).and_then(|scan| find(bytes, scan, &[0xFF, 0xD9]));
    std::iter::from_fn(move || {
        let start = find(bytes, from?, &[0xFF, 0xD8, 0xFF])?;
        let other = &bytes[start..];
        let header = walk(other).last().map_or(3, |(at, _, content)| at + 4 + content.len());
        from = Some(start + header);
        Some(other)
    })
}

/// What its segments say, but for the profile itself, which is left to the decoder.
pub(super) fn tags(bytes: &[u8]) -> Tags {
    let (packets, note) = packets(bytes);
    let exif = exif(bytes).map(<[u8]>::to_vec);
    Tags {
        exif,
        packets,
        has_profile: has_profile(bytes),
        notes: note.into_iter().collect(),
        ..Tags::default()
    }
}

/// The first EXIF data: what stands behind is of who added to the file without reading it.
fn exif(bytes: &[u8]) -> Option<&[u8]> {
    segments(bytes).find_map(|(marker, content)| match content {
        // the last byte of the name is 0, or by some writers 0xFF
        [b'E', b'x', b'i', b'f', 0, _, exif @ ..] if marker == 0xE1 => Some(exif),
        _ => None,
    })
}

/// Whether there are segments of a colour profile, be it too few or too many.
fn has_profile(bytes: &[u8]) -> bool {
    segments(bytes).any(|(marker, content)| marker == 0xE2 && content.starts_with(b"ICC_PROFILE\0"))
}

/// Whether a segment of ISO 21496-1 says that there is a gain map.
pub(super) fn has_iso_gain_map(bytes: &[u8]) -> bool {
    segments(bytes)
        .any(|(marker, content)| marker == 0xE2 && content.starts_with(b"urn:iso:std:iso:ts:21496:-1"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_in_the_segments_of_a_picture_is_no_other() {
        // a scan, its end, a picture; then one of whose segments each begins like one
        let first = b"\xFF\xD8\xFF\xDA\0\x02\x00\xFF\xD9";
        let second = b"\xFF\xD8\xFF\xE1\0\x05\xFF\xD8\xFF\xFF\xDA\0\x02\x00\xFF\xD9";
        let nested = b"\xFF\xE1\0\x08\xFF\xD8\xFF\xE1\0\x02".repeat(300_000);
        let bytes = [&first[..], second, b"\xFF\xD8", &nested].concat();
        let starts: Vec<_> = others(&bytes).map(|other| bytes.len() - other.len()).collect();
        assert_eq!(starts, [first.len(), first.len() + second.len()]);
    }
}
