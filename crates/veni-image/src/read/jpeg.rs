//! The segments of a JPEG file (ITU-T T.81), and the pictures behind the first.

/// Markers with their content, up to the first scan.
pub(super) fn segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut at = 2;
    std::iter::from_fn(move || {
        let &[0xFF, marker, high, low] = bytes.get(at..at + 4)? else { return None };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let content = bytes.get(at + 4..at + 2 + length)?;
        at += 2 + length;
        (marker != 0xDA).then_some((marker, content))
    })
}

/// Where the first scan begins; nothing where fill bytes or no scan at all leave that to the decoder.
fn scan(bytes: &[u8]) -> Option<usize> {
    let mut at = 2;
    while let Some(&[0xFF, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == 0xDA {
            return Some(at);
        }
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
    }
    None
}

fn find(bytes: &[u8], from: usize, name: &[u8]) -> Option<usize> {
    bytes.get(from..)?.windows(name.len()).position(|window| window == name).map(|at| from + at)
}

/// Whether there is an end marker behind the start of its first scan; the decoder paints what is missing grey. Segments before
/// the scan are stepped over: thumbnails in them have an end of their own.
pub(super) fn ends(bytes: &[u8]) -> bool {
    scan(bytes).is_none_or(|scan| find(bytes, scan, &[0xFF, 0xD9]).is_some())
}

/// Whatever begins like a picture behind the end of the first (CIPA DC-007 puts them there).
pub(super) fn others(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut from = scan(bytes).and_then(|scan| find(bytes, scan, &[0xFF, 0xD9]));
    std::iter::from_fn(move || {
        let start = find(bytes, from?, &[0xFF, 0xD8, 0xFF])?;
        from = Some(start + 3);
        Some(&bytes[start..])
    })
}

/// Its XMP packet.
pub(super) fn xmp(bytes: &[u8]) -> Option<&str> {
    let packet = segments(bytes).find_map(|(marker, content)| {
        content.strip_prefix(b"http://ns.adobe.com/xap/1.0/\0").filter(|_| marker == 0xE1)
    })?;
    std::str::from_utf8(packet).ok()
}

/// Whether there are segments of a colour profile, be it too few or too many.
pub(super) fn has_profile(bytes: &[u8]) -> bool {
    segments(bytes).any(|(marker, content)| marker == 0xE2 && content.starts_with(b"ICC_PROFILE\0"))
}

/// Whether a segment of ISO 21496-1 says that there is a gain map.
pub(super) fn has_iso_gain_map(bytes: &[u8]) -> bool {
    segments(bytes)
        .any(|(marker, content)| marker == 0xE2 && content.starts_with(b"urn:iso:std:iso:ts:21496:-1"))
}
