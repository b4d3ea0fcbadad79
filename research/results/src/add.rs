//! `add`: a table that `veni-cli evaluate … --table json --out DIR` has written, into a topic's data file.

use std::path::Path;
use std::process::Command;

use serde::Deserialize;
use serde::de::{MapAccess, Visitor};
use serde_json::Value;

use crate::data::{Cell, Entry, Topic};
use crate::{Result, USAGE, date, option};

/// `{name, title, rows: [{column: value}], notes}`; `columns`, if it is there, is the order of the columns.
#[derive(Debug, Deserialize)]
struct Evaluated {
    title: String,
    rows: Vec<Row>,
    notes: Vec<String>,
    columns: Option<Vec<String>>,
}

/// An object in the order of its file.
#[derive(Debug)]
struct Row(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Row {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Pairs;
        impl<'de> Visitor<'de> for Pairs {
            type Value = Row;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("an object {column: value}")
            }
            fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> std::result::Result<Row, M::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Row(pairs))
            }
        }
        deserializer.deserialize_map(Pairs)
    }
}

/// Reads the table named by the first word and writes it into its topic's file.
pub(crate) fn run(folder: &Path, mut words: Vec<String>) -> Result<()> {
    let needed = |name: &str, value: Option<String>| value.ok_or(format!("add needs {name}\n{USAGE}"));
    let name = needed("--topic", option(&mut words, "--topic")?)?;
    let command = needed("--command", option(&mut words, "--command")?)?;
    let title = option(&mut words, "--title")?;
    let columns = option(&mut words, "--columns")?.map(|c| c.split(',').map(str::to_owned).collect());
    let commit = option(&mut words, "--commit")?.or_else(|| head(folder));
    let date = option(&mut words, "--date")?.unwrap_or_else(date::today);
    let mut before = Vec::new();
    while let Some(note) = option(&mut words, "--note")? {
        before.push(note);
    }
    let replace = words.iter().position(|word| word == "--replace").map(|at| words.remove(at)).is_some();
    let [file] = words.as_slice() else {
        return Err(format!("add takes one file, not {}\n{USAGE}", words.len()));
    };
    let text = std::fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
    let mut entry = entry(&text, columns).map_err(|e| format!("{file}: {e}"))?;
    entry.title = title.unwrap_or(entry.title);
    entry = Entry { command: Some(command), commit, date: Some(date), before, ..entry };
    let mut topic = Topic::load(folder, &name)?;
    insert(&mut topic, entry, replace)?;
    let text = topic.print();
    Topic::parse(&text)?;
    let path = folder.join("data").join(format!("{name}.json"));
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The table as an entry, numbers with all their digits.
fn entry(text: &str, columns: Option<Vec<String>>) -> Result<Entry> {
    let table: Evaluated = serde_json::from_str(text)
        .map_err(|e| format!("is not a table of 'veni-cli evaluate --table json' ({e})"))?;
    let first = table.rows.first().ok_or("the table has no rows")?;
    let header = columns
        .or(table.columns)
        .unwrap_or_else(|| first.0.iter().map(|(column, _)| column.clone()).collect());
    let mut rows = Vec::new();
    for Row(pairs) in &table.rows {
        if let Some((column, _)) = pairs.iter().find(|(column, _)| !header.contains(column)) {
            return Err(format!("column \"{column}\" is not among the columns {}", header.join(", ")));
        }
        let cell = |title: &String| {
            let found = pairs.iter().find(|(column, _)| column == title);
            let (_, value) = found.ok_or(format!("a row has no column \"{title}\""))?;
            match value {
                Value::String(text) => Ok(Cell::Text(text.clone())),
                Value::Number(number) => Ok(Cell::Number(number.clone())),
                other => Err(format!("column \"{title}\": {other} is neither text nor a number")),
            }
        };
        rows.push(header.iter().map(cell).collect::<Result<Vec<_>>>()?);
    }
    let (title, after) = (table.title, table.notes);
    Ok(Entry { title, command: None, commit: None, date: None, before: Vec::new(), header, rows, after })
}

fn insert(topic: &mut Topic, entry: Entry, replace: bool) -> Result<()> {
    match topic.entries.iter_mut().find(|e| e.title == entry.title) {
        Some(old) if replace => *old = entry,
        Some(_) => {
            return Err(format!("\"{}\" is there already; --replace, or another --title", entry.title));
        }
        None => topic.entries.push(entry),
    }
    Ok(())
}

/// The commit that is checked out.
fn head(folder: &Path) -> Option<String> {
    let output =
        Command::new("git").arg("-C").arg(folder).args(["rev-parse", "--short", "HEAD"]).output().ok()?;
    let hash = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| hash.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::tests::topic;

    const TABLE: &str = r#"{"name":"reconstruction","notes":["A note."],"rows":[
        {"System":"VENI","LDR PSNR":18.4512,"LPIPS":"no weights"},
        {"System":"RENI++","LDR PSNR":16.6,"LPIPS":"no weights"}],"title":"Reconstruction"}"#;

    #[test]
    fn a_table_of_evaluate_becomes_an_entry() {
        let entry = entry(TABLE, None).unwrap();
        assert_eq!(entry.header, ["System", "LDR PSNR", "LPIPS"]);
        assert_eq!(entry.rows[0][1], Cell::Number(serde_json::Number::from_f64(18.4512).unwrap()));
        assert_eq!((entry.title.as_str(), entry.after[0].as_str()), ("Reconstruction", "A note."));
    }

    #[test]
    fn columns_can_be_put_in_order_but_not_lost() {
        let columns = |names: &[&str]| Some(names.iter().map(|&n| n.to_owned()).collect());
        let ordered = entry(TABLE, columns(&["LPIPS", "System", "LDR PSNR"])).unwrap();
        assert_eq!(ordered.rows[1][1], Cell::Text("RENI++".into()));
        assert!(entry(TABLE, columns(&["System", "LPIPS"])).unwrap_err().contains("LDR PSNR"));
        assert!(
            entry(TABLE, columns(&["System", "LDR PSNR", "LPIPS", "SSIM"])).unwrap_err().contains("SSIM")
        );
    }

    #[test]
    fn what_is_no_table_is_refused() {
        assert!(entry("{}", None).unwrap_err().contains("evaluate"));
        assert!(entry(&TABLE.replace("16.6", "null"), None).unwrap_err().contains("null"));
        assert!(entry(r#"{"title":"t","rows":[],"notes":[]}"#, None).unwrap_err().contains("no rows"));
    }

    #[test]
    fn an_entry_is_replaced_only_when_told_to() {
        let mut topic = topic();
        let again = Entry { before: vec![], ..topic.entries[0].clone() };
        assert!(insert(&mut topic, again.clone(), false).unwrap_err().contains("--replace"));
        insert(&mut topic, again.clone(), true).unwrap();
        assert_eq!(topic.entries, [again]);
    }
}
