//! From data to Markdown.

use crate::data::{Cell, Entry, Topic};
use crate::wrap::wrap;

/// The page of one topic.
pub(crate) fn topic(name: &str, topic: &Topic) -> String {
    let mut parts = vec![format!("# {}", topic.title), generated(&format!("data/{name}.json"))];
    parts.extend(topic.introduction.iter().map(|p| wrap(p)));
    if topic.entries.len() > 2 {
        let link = |entry: &Entry| format!("- [{}](#{})", entry.title, anchor(&entry.title));
        parts.push(topic.entries.iter().map(link).collect::<Vec<_>>().join("\n"));
    }
    parts.extend(topic.entries.iter().map(entry));
    parts.join("\n\n") + "\n"
}

/// The list of all topics and their tables.
pub(crate) fn index(topics: &[(String, Topic)]) -> String {
    let mut parts = vec![
        "# Measured results in full".to_owned(),
        generated("data/"),
        wrap(
            "The summary is [docs/RESULTS.md](../RESULTS.md). Commands are as they were typed at the commit that stands \
             beside each table: the commit that was measured or, where that is not known, the one that recorded the \
             numbers. `hdri/` stands for a folder of HDR panoramas with `train/` (76 outdoor) and `val/` (8 others).",
        ),
    ];
    for (name, topic) in topics {
        let item = |entry: &Entry| {
            let date = entry.date.as_ref().map_or(String::new(), |date| format!(" ({date})"));
            format!("- [{}]({name}.md#{}){date}", entry.title, anchor(&entry.title))
        };
        let items: Vec<_> = topic.entries.iter().map(item).collect();
        parts.push(format!("## [{}]({name}.md)", topic.title));
        parts.push(wrap(&topic.summary));
        parts.push(items.join("\n"));
    }
    parts.join("\n\n") + "\n"
}

fn generated(from: &str) -> String {
    format!("*Generated from [{from}]({from}) by `cargo run --release -p veni-results`.*")
}

fn entry(entry: &Entry) -> String {
    let mut parts = vec![format!("## {}", entry.title)];
    let source = match (&entry.date, &entry.commit) {
        (Some(date), Some(commit)) => format!("*{date}, commit {commit}.*"),
        (Some(date), None) => format!("*{date}.*"),
        (None, Some(commit)) => format!("*Commit {commit}.*"),
        (None, None) => String::new(),
    };
    if !source.is_empty() {
        parts.push(source);
    }
    parts.push(match &entry.command {
        Some(command) => format!("```sh\n{command}\n```"),
        None => "*Command not recorded.*".to_owned(),
    });
    parts.extend(entry.before.iter().map(|p| wrap(p)));
    if !entry.header.is_empty() {
        let line = |cells: Vec<String>| format!("| {} |", cells.join(" | "));
        let mut table = vec![line(entry.header.iter().map(|title| escape(title)).collect())];
        table.push(format!("|{}", "---|".repeat(entry.header.len())));
        table.extend(entry.rows.iter().map(|row| line(row.iter().map(shown).collect())));
        parts.push(table.join("\n"));
    }
    parts.extend(entry.after.iter().map(|p| wrap(p)));
    parts.join("\n\n")
}

fn escape(text: &str) -> String {
    text.replace('|', r"\|")
}

/// A cell for people: numbers with three significant digits, or two after the point where that is more.
fn shown(cell: &Cell) -> String {
    let number = match cell {
        Cell::Text(text) => return escape(text),
        Cell::Number(number) => number,
    };
    let value = number.as_f64().unwrap_or(f64::NAN);
    if number.is_u64() || number.is_i64() {
        number.to_string()
    } else if value != 0.0 && value.abs() < 0.01 || value.abs() >= 1e5 {
        format!("{value:.1e}")
    } else if value.abs() < 10.0 {
        format!("{value:.3}")
    } else {
        format!("{value:.2}")
    }
}

/// The anchor that Markdown viewers give a heading: lower case, words joined by hyphens, punctuation left out.
pub(crate) fn anchor(title: &str) -> String {
    title
        .to_lowercase()
        .chars()
        .filter_map(|c| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
            _ => None,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::tests::topic as example;

    #[test]
    fn a_page_holds_title_source_command_notes_and_table() {
        let expected = "# T\n\n*Generated from [data/t.json](data/t.json) by `cargo run --release -p veni-results`.*\n\n\
             ## Small\n\n*2026-11-28.*\n\n```sh\nveni-cli bench\n```\n\nA \"quoted\" word.\n\n\
             | system | dB |\n|---|---|\n| a\\|b | 12.35 |\n";
        assert_eq!(topic("t", &example()), expected);
    }

    fn number(value: f64) -> Cell {
        Cell::Number(serde_json::Number::from_f64(value).unwrap())
    }

    #[test]
    fn numbers_are_rounded_by_their_size() {
        let shown = |value| shown(&number(value));
        assert_eq!(
            [shown(1.23456), shown(23.4567), shown(4.56e-5), shown(0.0), shown(1.5e6)],
            ["1.235", "23.46", "4.6e-5", "0.000", "1.5e6"]
        );
        assert_eq!(super::shown(&Cell::Number(1000.into())), "1000");
    }

    #[test]
    fn anchors_are_those_of_markdown_viewers() {
        assert_eq!(anchor("D = 27, 6,000 updates"), "d--27-6000-updates");
    }

    #[test]
    fn the_index_links_every_entry() {
        let index = index(&[("t".to_owned(), example())]);
        assert!(index.contains("- [Small](t.md#small) (2026-11-28)"), "{index}");
    }
}
