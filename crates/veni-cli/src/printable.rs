//! Text from files as a terminal may see it: names and attributes can hold escape sequences.

use std::borrow::Cow;
use std::fmt::Write;

/// One line: control characters, and those that change the direction of writing, as escapes (`\u{1b}`, `\n`).
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| acts(c) || c == '\n' || c == '\t', |out, c| out.extend(c.escape_default()))
}

/// Several lines, which stay as they are but for what [`printable`] escapes in them.
pub(crate) fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, acts, |out, c| out.extend(c.escape_default()))
}

/// JSON, in which such characters are inside strings: the escapes are JSON's.
pub(crate) fn printable_json(text: &str) -> Cow<'_, str> {
    escaped(text, acts, |out, c| {
        for unit in c.encode_utf16(&mut [0; 2]) {
            // writing to a String cannot fail
            let _ = write!(out, "\\u{unit:04x}");
        }
    })
}

/// Whether a terminal does something at this character other than to show it.
fn acts(c: char) -> bool {
    (c.is_control() && c != '\n' && c != '\t')
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

fn escaped(
    text: &str,
    is_escaped: impl Fn(char) -> bool,
    escape: impl Fn(&mut String, char),
) -> Cow<'_, str> {
    if !text.chars().any(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_escaped(c) { escape(&mut out, c) } else { out.push(c) }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAW: &str = "a\u{1b}[31m\u{9b}2J\r\u{7}\u{202e}\u{7f}ä\t\n";

    #[test]
    fn nothing_that_acts_is_left() {
        assert_eq!(printable(RAW), r"a\u{1b}[31m\u{9b}2J\r\u{7}\u{202e}\u{7f}ä\t\n");
        assert_eq!(printable_lines(RAW), "a\\u{1b}[31m\\u{9b}2J\\r\\u{7}\\u{202e}\\u{7f}ä\t\n");
        assert!(matches!(printable("Größe µ 天.exr"), Cow::Borrowed(_)));
    }

    #[test]
    fn json_stays_what_it_says() {
        let json = serde_json::to_string(&[RAW]).unwrap();
        let shown = printable_json(&json);
        assert!(!shown.chars().any(|c| c.is_control() || c == '\u{202e}'), "{shown}");
        assert_eq!(serde_json::from_str::<[String; 1]>(&shown).unwrap(), [RAW]);
    }
}
