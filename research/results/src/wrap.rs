//! Paragraphs in lines of bounded width.

/// The longest line, in characters.
pub(crate) const WIDTH: usize = 125;

/// The paragraph in lines; an item of a list ("- …") goes on indented. A picture stays on one line.
pub(crate) fn wrap(paragraph: &str) -> String {
    let indent = if paragraph.starts_with("- ") { "  " } else { "" };
    let mut lines: Vec<String> = Vec::new();
    for word in words(paragraph) {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= WIDTH => {
                line.push(' ');
                line.push_str(&word);
            }
            Some(_) => lines.push(format!("{indent}{word}")),
            None => lines.push(word),
        }
    }
    lines.join("\n")
}

/// What may stand at the beginning of a line: a word that Markdown would take for the mark of a list, heading, quotation
/// or table there stays with the word before it.
fn words(paragraph: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for word in paragraph.split_whitespace() {
        let number = word.strip_suffix(['.', ')']).is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()));
        let mark = word.bytes().all(|b| b"-+*=_".contains(&b)) || word.starts_with(['#', '>', '|']);
        match words.last_mut() {
            Some(last) if mark || number => {
                last.push(' ');
                last.push_str(word);
            }
            _ => words.push(word.to_owned()),
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_full_but_not_longer() {
        let text = "wort ".repeat(100);
        let wrapped = wrap(&text);
        let lengths: Vec<_> = wrapped.lines().map(|line| line.chars().count()).collect();
        assert_eq!(lengths, [124, 124, 124, 124]);
        assert_eq!(wrapped.split_whitespace().count(), 100);
    }

    #[test]
    fn no_line_begins_with_a_mark_of_markdown() {
        let text = format!("{} - 3 + 4 12. 5) # >a |b = *", "x".repeat(121));
        let begins: Vec<_> = wrap(&text).lines().map(|line| line.chars().next().unwrap()).collect();
        assert!(begins.iter().all(|c| c.is_alphanumeric()), "{begins:?}");
        let list = wrap(&format!("- {}", "y ".repeat(80)));
        assert!(list.lines().nth(1).unwrap().starts_with("  y"));
    }
}
