//! Just enough of Rust's grammar to find names and texts: no comments, no numbers.

/// A piece of source text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    /// An identifier or a keyword.
    Word(String),
    /// `::`.
    Path,
    /// What stands in a string.
    Text(String),
    /// Any other character.
    Sign(char),
}

/// The tokens of a file, without the items that are only there for tests.
pub(crate) fn tokens(text: &str) -> Vec<Token> {
    without_tests(&all(text))
}

fn all(text: &str) -> Vec<Token> {
    let text: Vec<char> = text.chars().collect();
    let (mut found, mut at) = (Vec::new(), 0);
    while let Some(&c) = text.get(at) {
        at = match c {
            '/' if text.get(at + 1) == Some(&'/') => find(&text, at, |rest| rest[0] == '\n'),
            '/' if text.get(at + 1) == Some(&'*') => {
                find(&text, at + 2, |rest| rest.starts_with(&['*', '/'])) + 2
            }
            '"' | 'r' | 'b' | 'c' if any_string(&text, at).is_some() => {
                let (string, end) = any_string(&text, at).unwrap_or_default();
                found.push(Token::Text(string));
                end
            }
            '\'' => quote(&text, at),
            ':' if text.get(at + 1) == Some(&':') => {
                found.push(Token::Path);
                at + 2
            }
            c if c.is_alphabetic() || c == '_' => {
                let end = find(&text, at, |rest| !(rest[0].is_alphanumeric() || rest[0] == '_'));
                found.push(Token::Word(text[at..end].iter().collect()));
                end
            }
            c if c.is_ascii_digit() => find(&text, at, |rest| !(rest[0].is_alphanumeric() || rest[0] == '_')),
            c => {
                if !c.is_whitespace() {
                    found.push(Token::Sign(c));
                }
                at + 1
            }
        };
    }
    found
}

/// The first place from `at` on that is meant, or the end.
fn find(text: &[char], at: usize, is_it: impl Fn(&[char]) -> bool) -> usize {
    (at..text.len()).find(|k| is_it(&text[*k..])).unwrap_or(text.len())
}

/// The string of any kind that begins at `at`, and the place behind it.
fn any_string(text: &[char], at: usize) -> Option<(String, usize)> {
    let prefix = find(text, at, |rest| !['r', 'b', 'c'].contains(&rest[0]));
    let quote = find(text, prefix, |rest| rest[0] != '#');
    if prefix - at > 2 || text.get(quote) != Some(&'"') {
        return None;
    }
    if !text[at..prefix].contains(&'r') {
        return (quote == prefix).then(|| string(text, quote));
    }
    let mut sign = vec!['"'];
    sign.extend(vec!['#'; quote - prefix]);
    let end = find(text, quote + 1, |rest| rest.starts_with(&sign));
    Some((text[quote + 1..end].iter().collect(), end + sign.len()))
}

/// The string whose first quote is at `at`, its escapes resolved as far as they change words, and the place behind it.
fn string(text: &[char], at: usize) -> (String, usize) {
    let (mut string, mut at) = (String::new(), at + 1);
    while let Some(c) = text.get(at) {
        at += 1;
        match (c, text.get(at)) {
            ('"', _) => break,
            ('\\', Some('\n')) => at = find(text, at, |rest| !rest[0].is_whitespace()),
            ('\\', Some('n')) => {
                string.push('\n');
                at += 1;
            }
            ('\\', Some(escaped)) => {
                string.push(*escaped);
                at += 1;
            }
            (c, _) => string.push(*c),
        }
    }
    (string, at)
}

/// Behind a character, or behind the sign of a lifetime.
fn quote(text: &[char], at: usize) -> usize {
    match (text.get(at + 1), text.get(at + 2)) {
        (Some('\\'), _) => find(text, at + 3, |rest| rest[0] == '\'') + 1,
        (_, Some('\'')) => at + 3,
        _ => at + 1,
    }
}

fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let test: Vec<Token> = all("#[cfg(test)]");
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if tokens[at..].starts_with(&test) {
            at = item_end(tokens, at + test.len());
        } else {
            kept.push(tokens[at].clone());
            at += 1;
        }
    }
    kept
}

/// Behind an item: its `;`, or the bracket that closes its first `{`.
fn item_end(tokens: &[Token], from: usize) -> usize {
    let (mut depth, mut at) = (0usize, from);
    while at < tokens.len() {
        at += 1;
        match tokens[at - 1] {
            Token::Sign('{' | '(' | '[') => depth += 1,
            Token::Sign('}') if depth == 1 => return at,
            Token::Sign('}' | ')' | ']') => depth = depth.saturating_sub(1),
            Token::Sign(';') if depth == 0 => return at,
            _ => {}
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_code_is_left() {
        let text = r##"
            // use a;
            /* use b; */
            let s = "use \" c \
                and"; let r = r#"use " d"#; let b = b"e"; let c = '"'; let x: &'static str = 'f';
            #[cfg(test)] mod tests { fn g() { [1; 2] } }
            #[cfg(test)] use h;
            use i::j;
        "##;
        let found = tokens(text);
        let texts: Vec<_> = found
            .iter()
            .filter_map(|t| match t {
                Token::Text(text) => Some(text.as_str()),
                _ => None,
            })
            .collect();
        assert_eq!(texts, ["use \" c and", "use \" d", "e"]);
        let words: Vec<_> = found
            .into_iter()
            .filter_map(|t| match t {
                Token::Word(word) => Some(word),
                _ => None,
            })
            .collect();
        assert_eq!(
            words,
            ["let", "s", "let", "r", "let", "b", "let", "c", "let", "x", "static", "str", "use", "i", "j"]
        );
    }
}
