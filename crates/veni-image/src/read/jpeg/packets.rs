//! The XMP packets of a JPEG (ISO 16684-3): those that fit into a segment, and those that are spread over several.

use super::super::xmp::{self, EXTENSION, Namespace};
use super::segments;
use crate::limits::MAX_METADATA_BYTES;

/// How a segment with a whole packet begins.
const WHOLE: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
/// How a piece of an extended packet begins.
const PIECE: &[u8] = b"http://ns.adobe.com/xmp/extension/\0";

/// All packets, and what of them is missing. Extended ones count where a whole one names them by their digest; the others are
/// left over from an earlier state of the file.
pub(in crate::read) fn packets(bytes: &[u8]) -> (Vec<String>, Option<String>) {
    let contents = |name: &'static [u8]| {
        segments(bytes)
            .filter_map(move |(marker, content)| content.strip_prefix(name).filter(|_| marker == 0xE1))
    };
    let mut packets: Vec<String> = contents(WHOLE).map(xmp::text).collect();
    let named = Namespace::first(&packets, EXTENSION).and_then(|note| note.text("HasExtendedXMP"));
    let Some(digest) = named.filter(|digest| digest.len() == 32).map(str::to_owned) else {
        return (packets, None);
    };
    match join(contents(PIECE), &digest) {
        Ok(packet) => packets.push(packet),
        Err(note) => return (packets, Some(note)),
    }
    (packets, None)
}

/// The packet of this `digest` from its pieces: digest, length of the whole, where the piece stands in it, content.
fn join<'a>(pieces: impl Iterator<Item = &'a [u8]>, digest: &str) -> Result<String, String> {
    let mut found: Vec<(u32, u32, &[u8])> = pieces
        .filter_map(|piece| piece.strip_prefix(digest.as_bytes()))
        .filter_map(|piece| match piece {
            &[a, b, c, d, e, f, g, h, ref content @ ..] => {
                Some((u32::from_be_bytes([a, b, c, d]), u32::from_be_bytes([e, f, g, h]), content))
            }
            _ => None,
        })
        .collect();
    found.sort_by_key(|(_, at, _)| *at);
    found.dedup();
    let whole = found.first().map_or(0, |(whole, ..)| *whole);
    let mut packet = Vec::new();
    for (length, at, content) in &found {
        let fits = *length == whole && *at as usize == packet.len();
        if !fits || (packet.len() + content.len()) as u64 > MAX_METADATA_BYTES {
            break;
        }
        packet.extend_from_slice(content);
    }
    if packet.len() == whole as usize && !packet.is_empty() {
        return Ok(xmp::text(&packet));
    }
    Err(format!(
        "its extended XMP is incomplete ({} of {whole} bytes are there): it is ignored",
        packet.len()
    ))
}
