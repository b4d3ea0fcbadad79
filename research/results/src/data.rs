//! The data files: one topic each, a list of measured tables with the command, commit and date of each.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Result;

/// What stands in a table: text as it is shown, or a number with all its digits.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
pub(crate) enum Cell {
    /// Shown as it is.
    Text(String),
    /// Rounded by the page.
    Number(serde_json::Number),
}

/// One measurement: a table, or a paragraph of numbers without one.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    pub(crate) title: String,
    /// The commands that make it, a line each; absent where none was recorded.
    pub(crate) command: Option<String>,
    /// The commit that was measured or, where that is not known, the one that recorded the numbers.
    pub(crate) commit: Option<String>,
    /// YYYY-MM-DD.
    pub(crate) date: Option<String>,
    /// Paragraphs of Markdown before the table.
    pub(crate) before: Vec<String>,
    /// Column titles; empty without a table.
    pub(crate) header: Vec<String>,
    pub(crate) rows: Vec<Vec<Cell>>,
    /// Paragraphs of Markdown after the table.
    pub(crate) after: Vec<String>,
}

/// A page.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Topic {
    pub(crate) title: String,
    /// Its place in the index.
    pub(crate) order: u32,
    /// One line for the index.
    pub(crate) summary: String,
    pub(crate) introduction: Vec<String>,
    pub(crate) entries: Vec<Entry>,
}

impl Topic {
    /// Reads `FOLDER/data/NAME.json` and checks it.
    pub(crate) fn load(folder: &Path, name: &str) -> Result<Self> {
        let path = folder.join("data").join(format!("{name}.json"));
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Self::parse(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Every topic of `FOLDER/data`, in the order of the index.
    pub(crate) fn all(folder: &Path) -> Result<Vec<(String, Self)>> {
        let names = names(&folder.join("data"), "json")?;
        let mut topics = Vec::new();
        for name in names {
            let topic = Self::load(folder, &name)?;
            topics.push((name, topic));
        }
        topics.sort_by_key(|(name, topic)| (topic.order, name.clone()));
        Ok(topics)
    }

    pub(crate) fn parse(text: &str) -> Result<Self> {
        let topic: Self = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let mut titles = BTreeMap::new();
        for entry in &topic.entries {
            let Entry { title, header, rows, date, .. } = entry;
            if titles.insert(title, ()).is_some() {
                return Err(format!("two entries are called \"{title}\""));
            }
            if let Some(row) = rows.iter().find(|row| row.len() != header.len()) {
                return Err(format!(
                    "\"{title}\": a row of {} cells under {} titles",
                    row.len(),
                    header.len()
                ));
            }
            let is_date = |date: &str| {
                date.len() == 10
                    && date
                        .bytes()
                        .enumerate()
                        .all(|(i, b)| if i == 4 || i == 7 { b == b'-' } else { b.is_ascii_digit() })
            };
            if let Some(date) = date.as_deref().filter(|date| !is_date(date)) {
                return Err(format!("\"{title}\": {date} is not a date (YYYY-MM-DD)"));
            }
        }
        Ok(topic)
    }

    /// The file's text: a paragraph and a row to a line, so that a changed number is a changed line.
    pub(crate) fn print(&self) -> String {
        let json = |value: &dyn Fn() -> serde_json::Result<String>| value().unwrap_or_default();
        let text = |text: &str| json(&|| serde_json::to_string(text));
        let maybe = |value: &Option<String>| json(&|| serde_json::to_string(value));
        let lines = |indent: &str, lines: Vec<String>| {
            if lines.is_empty() {
                return "[]".to_owned();
            }
            let separator = format!(",\n{indent}  ");
            format!("[\n{indent}  {}\n{indent}]", lines.join(&separator))
        };
        let paragraphs = |indent: &str, all: &[String]| lines(indent, all.iter().map(|p| text(p)).collect());
        let entry = |entry: &Entry| {
            let cell = |cell: &Cell| json(&|| serde_json::to_string(cell));
            let row = |row: &Vec<Cell>| format!("[{}]", row.iter().map(cell).collect::<Vec<_>>().join(", "));
            let header = entry.header.iter().map(|title| text(title)).collect::<Vec<_>>().join(", ");
            let fields = [
                ("title", text(&entry.title)),
                ("command", maybe(&entry.command)),
                ("commit", maybe(&entry.commit)),
                ("date", maybe(&entry.date)),
                ("before", paragraphs("      ", &entry.before)),
                ("header", format!("[{header}]")),
                ("rows", lines("      ", entry.rows.iter().map(row).collect())),
                ("after", paragraphs("      ", &entry.after)),
            ];
            let fields: Vec<_> =
                fields.iter().map(|(name, value)| format!("      \"{name}\": {value}")).collect();
            format!("{{\n{}\n    }}", fields.join(",\n"))
        };
        format!(
            "{{\n  \"title\": {},\n  \"order\": {},\n  \"summary\": {},\n  \"introduction\": {},\n  \"entries\": {}\n}}\n",
            text(&self.title),
            self.order,
            text(&self.summary),
            paragraphs("  ", &self.introduction),
            lines("  ", self.entries.iter().map(entry).collect()),
        )
    }
}

/// The names of a folder's files with this extension, without it, sorted.
pub(crate) fn names(folder: &Path, extension: &str) -> Result<Vec<String>> {
    let error = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut names = Vec::new();
    for file in std::fs::read_dir(folder).map_err(error)? {
        let path = file.map_err(error)?.path();
        if path.extension().is_some_and(|e| e == extension) {
            names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn topic() -> Topic {
        let entry = Entry {
            title: "Small".into(),
            command: Some("veni-cli bench".into()),
            commit: None,
            date: Some("2026-11-28".into()),
            before: vec!["A \"quoted\" word.".into()],
            header: vec!["system".into(), "dB".into()],
            rows: vec![vec![
                Cell::Text("a|b".into()),
                Cell::Number(serde_json::Number::from_f64(12.345).unwrap()),
            ]],
            after: vec![],
        };
        Topic { title: "T".into(), order: 1, summary: "S".into(), introduction: vec![], entries: vec![entry] }
    }

    #[test]
    fn what_is_printed_reads_as_it_was() {
        assert_eq!(Topic::parse(&topic().print()).unwrap(), topic());
    }

    #[test]
    fn the_data_files_are_in_the_form_that_add_writes() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/results");
        for (name, topic) in Topic::all(&folder).unwrap() {
            let text = std::fs::read_to_string(folder.join("data").join(format!("{name}.json"))).unwrap();
            assert!(topic.print() == text, "docs/results/data/{name}.json is not in the program's own form");
        }
    }

    #[test]
    fn rows_dates_and_titles_that_cannot_be_right_are_refused() {
        let broken = |change: &dyn Fn(&mut Topic)| {
            let mut topic = topic();
            change(&mut topic);
            Topic::parse(&topic.print()).unwrap_err()
        };
        assert!(broken(&|t| t.entries[0].header.truncate(1)).contains("2 cells under 1"));
        assert!(broken(&|t| t.entries[0].date = Some("28.11.2026".into())).contains("28.11.2026"));
        assert!(broken(&|t| t.entries.push(t.entries[0].clone())).contains("two entries"));
        assert!(
            Topic::parse(&topic().print().replace("\"after\"", "\"afer\"")).unwrap_err().contains("afer")
        );
    }
}
