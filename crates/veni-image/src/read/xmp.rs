//! XMP packets (ISO 16684-1): the properties of two namespaces, as attributes or as elements.
//!
//! A packet is written by few programs in few ways, so names are looked for without building a tree; what is not found counts as
//! not said.

/// Google's description of panoramas ("Photo Sphere XMP").
pub(super) const GPANO: &str = "http://ns.google.com/photos/1.0/panorama/";
/// Adobe's gain map specification 1.0.
pub(super) const GAIN_MAP: &str = "http://ns.adobe.com/hdr-gain-map/1.0/";
/// Apple's gain maps.
pub(super) const APPLE_GAIN_MAP: &str = "http://ns.apple.com/HDRGainMap/1.0/";

/// Adobe's notes, which name the rest of a packet that is too long for a segment of JPEG.
pub(super) const EXTENSION: &str = "http://ns.adobe.com/xmp/note/";
/// TIFF's tags as properties.
pub(super) const TIFF: &str = "http://ns.adobe.com/tiff/1.0/";

/// The text of a packet: UTF-8, or by its first bytes UTF-16 or UTF-32 (ISO 16684-1, 7.1). What is none becomes U+FFFD: one
/// wrong byte in a title is no reason to forget where the picture lies in its panorama. Without comments, which say nothing.
pub(super) fn text(bytes: &[u8]) -> String {
    without_comments(decoded(bytes))
}

/// What stands between `<!--` and `-->`, or behind the first that is not closed, is left out.
fn without_comments(packet: String) -> String {
    let mut left = packet.as_str();
    let mut said = String::new();
    while let Some((before, comment)) = left.split_once("<!--") {
        said.push_str(before);
        left = comment.split_once("-->").map_or("", |(_, behind)| behind);
    }
    if said.is_empty() && left.len() == packet.len() {
        return packet;
    }
    said + left
}

fn decoded(bytes: &[u8]) -> String {
    let units = |rest: &[u8], unit: fn([u8; 2]) -> u16| -> String {
        let units = rest.as_chunks().0.iter().map(|pair| unit(*pair));
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    let points = |rest: &[u8], point: fn([u8; 4]) -> u32| -> String {
        let points = rest.as_chunks().0.iter().map(|four| point(*four));
        points.map(|p| char::from_u32(p).unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    match bytes {
        // with a mark of the byte order in front, or where that stands in the packet's first line, with its first letter
        [0xFF, 0xFE, 0, 0, rest @ ..] => points(rest, u32::from_le_bytes),
        [0, 0, 0xFE, 0xFF, rest @ ..] => points(rest, u32::from_be_bytes),
        [b'<', 0, 0, 0, ..] => points(bytes, u32::from_le_bytes),
        [0, 0, 0, b'<', ..] => points(bytes, u32::from_be_bytes),
        [0xFF, 0xFE, rest @ ..] => units(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => units(rest, u16::from_be_bytes),
        [b'<', 0, ..] => units(bytes, u16::from_le_bytes),
        [0, b'<', ..] => units(bytes, u16::from_be_bytes),
        _ => String::from_utf8_lossy(bytes).into_owned(),
    }
}

/// One namespace of a packet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Namespace<'a> {
    packet: &'a str,
    prefix: &'a str,
}

impl<'a> Namespace<'a> {
    /// Nothing if the packet does not name it.
    pub(super) fn find(packet: &'a str, uri: &str) -> Option<Self> {
        let at = packet.match_indices(uri).find_map(|(at, _)| {
            let closed = packet[at + uri.len()..].starts_with(['"', '\'']);
            let before = packet[..at].strip_suffix(['"', '\''])?.trim_end().strip_suffix('=')?.trim_end();
            let prefix = &before[before.rfind("xmlns:")? + "xmlns:".len()..];
            let is_name =
                !prefix.is_empty() && prefix.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c));
            (closed && is_name).then_some(prefix)
        });
        at.map(|prefix| Self { packet, prefix })
    }

    /// Of the first of several packets that names it.
    pub(super) fn first(packets: &'a [String], uri: &str) -> Option<Self> {
        packets.iter().find_map(|packet| Self::find(packet, uri))
    }

    /// The text of a property.
    pub(super) fn text(&self, name: &str) -> Option<&'a str> {
        let full = format!("{}:{name}", self.prefix);
        self.packet.match_indices(&full).find_map(|(at, _)| {
            let before = self.packet[..at].chars().next_back()?;
            let after = &self.packet[at + full.len()..];
            if before == '<' {
                let (_, content) = after.split_once('>').filter(|(tag, _)| tag.trim().is_empty())?;
                return content.find(&format!("</{full}")).map(|end| content[..end].trim());
            }
            let value = after.trim_start().strip_prefix('=')?.trim_start();
            let quote = value.chars().next().filter(|q| before.is_whitespace() && ['"', '\''].contains(q))?;
            value[1..].split(quote).next().map(str::trim)
        })
    }

    /// Its numbers: one, or those of a list; nothing where one of them is none.
    pub(super) fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        // list items stand between tags
        let words = self.text(name)?.split('<').filter_map(|part| part.split('>').next_back()).map(str::trim);
        let numbers: Option<Vec<f64>> = words.filter(|w| !w.is_empty()).map(|w| w.parse().ok()).collect();
        numbers.filter(|n| !n.is_empty() && n.iter().all(|v| v.is_finite()))
    }

    /// One number.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).and_then(|numbers| numbers.first().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_text_in_every_encoding() {
        let words = "<?xpacket begin='\u{FEFF}'?> café 🌞";
        let wide = |mark: &str, unit: fn(u16) -> [u8; 2]| -> Vec<u8> {
            format!("{mark}{words}").encode_utf16().flat_map(unit).collect()
        };
        let wider = |mark: &str, point: fn(u32) -> [u8; 4]| -> Vec<u8> {
            format!("{mark}{words}").chars().flat_map(|c| point(c as u32)).collect()
        };
        assert_eq!(text(words.as_bytes()), words);
        for mark in ["", "\u{FEFF}"] {
            assert_eq!(text(&wide(mark, u16::to_le_bytes)), words);
            assert_eq!(text(&wide(mark, u16::to_be_bytes)), words);
            assert_eq!(text(&wider(mark, u32::to_le_bytes)), words);
            assert_eq!(text(&wider(mark, u32::to_be_bytes)), words);
        }
        assert_eq!(text(b"<a>caf\xe9</a>"), "<a>caf\u{FFFD}</a>");
        assert_eq!(text(b"<\0a"), "<");
        assert_eq!(text(b"a<!-- b -->c<!--d--><!---->e<!-- f"), "ace");
    }

    #[test]
    fn attributes_elements_and_lists() {
        let packet = r#"<rdf:Description xmlns:g = 'http://ns.adobe.com/hdr-gain-map/1.0/' g:Version="1.0" g:GainMapMin = '-0.5'>
            <g:GainMapMax><rdf:Seq><rdf:li>1</rdf:li><rdf:li> 2.5</rdf:li></rdf:Seq></g:GainMapMax><g:Gamma>3</g:Gamma>
            <g:Empty/><g:Text>abc</g:Text></rdf:Description>"#;
        let gain = Namespace::find(packet, GAIN_MAP).unwrap();
        assert_eq!(gain.number("GainMapMin"), Some(-0.5));
        assert_eq!(gain.numbers("GainMapMax"), Some(vec![1.0, 2.5]));
        assert_eq!((gain.number("Gamma"), gain.text("Text")), (Some(3.0), Some("abc")));
        assert_eq!((gain.number("Gam"), gain.number("Empty"), gain.number("Text")), (None, None, None));
        assert!(Namespace::find(packet, GPANO).is_none());
        assert!(Namespace::find("http://ns.google.com/photos/1.0/panorama/", GPANO).is_none());
    }
}
