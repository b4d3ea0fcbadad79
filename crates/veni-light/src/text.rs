//! Text as files hold it: UTF-8, or with a byte order mark that says what it is.

use crate::{Error, Result};

/// The text of a file's bytes, without its byte order mark: UTF-8, or UTF-16 if it begins with a mark that says so, as
/// Windows PowerShell writes it; with the [`line_ends`] that readers know.
///
/// # Errors
/// [`Error::Invalid`] if it is not that.
pub fn decode(bytes: Vec<u8>) -> Result<String> {
    let utf16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let (units, rest) = bytes.as_chunks::<2>();
        let text = String::from_utf16(&units.iter().map(|u| unit(*u)).collect::<Vec<_>>());
        text.ok().filter(|_| rest.is_empty()).ok_or_else(|| Error::invalid("no text (damaged UTF-16)"))
    };
    match bytes.as_slice() {
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8(rest.to_vec()),
        _ => utf8(bytes),
    }
    .map(line_ends)
}

/// The same text with lines that end in LF, if they all end in CR alone, as those of old Macintosh programs do: to readers of lines
/// it would be a single one.
pub fn line_ends(text: String) -> String {
    if text.contains('\r') && !text.contains('\n') { text.replace('\r', "\n") } else { text }
}

/// Whether text begins with a JSON object, as far as its first bytes say; they may end anywhere.
pub fn begins_object(bytes: &[u8]) -> bool {
    let first = match bytes {
        [0xff, 0xfe, rest @ ..] => rest.iter().step_by(2).copied().find(|b| !b.is_ascii_whitespace()),
        [0xfe, 0xff, rest @ ..] => rest.iter().skip(1).step_by(2).copied().find(|b| !b.is_ascii_whitespace()),
        [0xef, 0xbb, 0xbf, rest @ ..] | rest => rest.trim_ascii_start().first().copied(),
    };
    first == Some(b'{')
}

fn utf8(bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|_| Error::invalid("no text"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_say_how_text_is_coded() {
        let text = "{\"name\": \"Größe 𝄞\"}\n";
        let wide = |bytes: fn(u16) -> [u8; 2], mark: [u8; 2]| {
            [mark.to_vec(), text.encode_utf16().flat_map(bytes).collect()].concat()
        };
        let coded = [
            text.as_bytes().to_vec(),
            [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            wide(u16::to_le_bytes, [0xff, 0xfe]),
            wide(u16::to_be_bytes, [0xfe, 0xff]),
        ];
        for bytes in coded {
            assert!(begins_object(&bytes[..8]), "{bytes:?}");
            assert_eq!(decode(bytes).unwrap(), text);
        }
        let lines = |text: &str| decode(text.as_bytes().to_vec()).unwrap();
        assert_eq!((lines("a\rb\r"), lines("a\r\nb")), ("a\nb\n".into(), "a\r\nb".into()));
        assert!(begins_object(b"\xef\xbb\xbf \n {") && !begins_object(b"[1]") && !begins_object(b""));
        for wrong in [&b"\xff\xfe\x00\xd8"[..], b"\xff\xfe\x41", b"\x80"] {
            assert!(decode(wrong.to_vec()).is_err(), "{wrong:?}");
        }
    }
}
