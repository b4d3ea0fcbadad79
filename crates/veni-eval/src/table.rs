//! Tables of results, and the three ways of writing them.

use serde::Serialize;
use serde_json::{Map, Value};

/// What stands in a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A name.
    Text(String),
    /// A number, shown with this many digits after the point; infinite and undefined ones are said in words.
    Number(f64, usize),
    /// A number that spans orders of magnitude, shown with two significant digits.
    Scientific(f64),
    /// No number, and why ("no weights").
    Missing(String),
}

impl Cell {
    /// A name.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// No number, and why.
    pub fn missing(why: impl Into<String>) -> Self {
        Self::Missing(why.into())
    }

    /// The number, if it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(value, _) | Self::Scientific(value) => Some(*value),
            Self::Text(_) | Self::Missing(_) => None,
        }
    }

    /// For people.
    fn shown(&self) -> String {
        match self {
            Self::Text(text) | Self::Missing(text) => text.clone(),
            Self::Number(value, _) | Self::Scientific(value) if !value.is_finite() => {
                words(*value).to_owned()
            }
            Self::Number(value, digits) => format!("{value:.digits$}"),
            Self::Scientific(value) => format!("{value:.1e}"),
        }
    }

    /// For programs: all digits.
    fn exact(&self) -> Value {
        match self {
            Self::Text(text) | Self::Missing(text) => text.as_str().into(),
            // JSON has no infinities
            Self::Number(value, _) | Self::Scientific(value) => {
                if value.is_finite() {
                    (*value).into()
                } else {
                    words(*value).into()
                }
            }
        }
    }
}

fn words(value: f64) -> &'static str {
    if value.is_nan() {
        "undefined"
    } else if value > 0.0 {
        "infinite"
    } else {
        "-infinite"
    }
}

/// A column's title, and whether the papers print such numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its title.
    pub title: String,
    /// Whether a published number may stand beside each of its numbers.
    pub published: bool,
}

/// A table. The first column names the row.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// A short name, usable as a file name.
    pub name: String,
    /// What it shows, in one line.
    pub title: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows, each as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
    /// How the numbers are to be read.
    pub notes: Vec<String>,
}

/// How a table is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Markdown, with title and notes.
    Markdown,
    /// Comma-separated values with all digits, title and notes left out.
    Csv,
    /// One line of JSON: `{name, title, rows: [{column: value}], notes}`, with all digits.
    Json,
}

impl Format {
    /// The extension of its files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Markdown => "md",
            Self::Csv => "csv",
            Self::Json => "json",
        }
    }
}

impl Table {
    /// An empty table. A title that begins with `*` is a number that the papers print too; the star is taken off.
    pub fn new(name: &str, title: &str, columns: &[&str]) -> Self {
        let column = |title: &&str| Column {
            title: title.trim_start_matches('*').to_owned(),
            published: title.starts_with('*'),
        };
        Self {
            name: name.to_owned(),
            title: title.to_owned(),
            columns: columns.iter().map(column).collect(),
            rows: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it has not one cell per column.
    pub fn push(&mut self, row: Vec<Cell>) {
        assert_eq!(row.len(), self.columns.len(), "table {}: a row of {} cells", self.name, row.len());
        self.rows.push(row);
    }

    /// Adds a remark.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// The cell in the column `title` of the row that begins with `row`.
    pub fn cell(&self, row: &str, title: &str) -> Option<&Cell> {
        let column = self.columns.iter().position(|c| c.title == title)?;
        let row = self.rows.iter().find(|r| matches!(&r[0], Cell::Text(name) if name == row))?;
        Some(&row[column])
    }

    /// The table as text, with a line end.
    pub fn render(&self, format: Format) -> String {
        match format {
            Format::Markdown => self.markdown(),
            Format::Csv => self.csv(),
            Format::Json => self.json() + "\n",
        }
    }

    fn markdown(&self) -> String {
        let escape = |text: &str| text.replace('|', r"\|");
        let line = |cells: &mut dyn Iterator<Item = String>| {
            let cells: Vec<_> = cells.collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let mut text = format!("**{}**\n\n", self.title);
        text += &line(&mut self.columns.iter().map(|c| escape(&c.title)));
        text += &line(&mut self.columns.iter().map(|_| "---".to_owned()));
        for row in &self.rows {
            text += &line(&mut row.iter().map(|cell| escape(&cell.shown())));
        }
        for note in &self.notes {
            text += &format!("\n{note}\n");
        }
        text
    }

    fn csv(&self) -> String {
        let quoted = |text: String| {
            if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
        };
        let line =
            |cells: &mut dyn Iterator<Item = String>| cells.map(quoted).collect::<Vec<_>>().join(",") + "\n";
        let plain = |cell: &Cell| match cell.exact() {
            Value::String(text) => text,
            number => number.to_string(),
        };
        let mut text = line(&mut self.columns.iter().map(|c| c.title.clone()));
        for row in &self.rows {
            text += &line(&mut row.iter().map(plain));
        }
        text
    }

    fn json(&self) -> String {
        #[derive(Serialize)]
        struct Shape<'a> {
            name: &'a str,
            title: &'a str,
            rows: Vec<Map<String, Value>>,
            notes: &'a [String],
        }
        let row = |cells: &Vec<Cell>| {
            let pairs = self.columns.iter().zip(cells);
            pairs.map(|(column, cell)| (column.title.clone(), cell.exact())).collect()
        };
        let rows = self.rows.iter().map(row).collect();
        let shape = Shape { name: &self.name, title: &self.title, rows, notes: &self.notes };
        serde_json::to_value(&shape).unwrap_or_default().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("t", "Title", &["System", "*PSNR", "LPIPS"]);
        table.push(vec![Cell::text("a|b, \"c\""), Cell::Number(12.3456, 2), Cell::missing("no weights")]);
        table.push(vec![Cell::text("d"), Cell::Number(f64::INFINITY, 2), Cell::Scientific(1.23e-7)]);
        table.note("A note.");
        table
    }

    #[test]
    fn markdown_is_for_people() {
        let expected = "**Title**\n\n| System | PSNR | LPIPS |\n| --- | --- | --- |\n\
                        | a\\|b, \"c\" | 12.35 | no weights |\n| d | infinite | 1.2e-7 |\n\nA note.\n";
        assert_eq!(table().render(Format::Markdown), expected);
    }

    #[test]
    fn csv_and_json_keep_every_digit() {
        let csv = table().render(Format::Csv);
        assert_eq!(csv, "System,PSNR,LPIPS\n\"a|b, \"\"c\"\"\",12.3456,no weights\nd,infinite,1.23e-7\n");
        let json: Value = serde_json::from_str(&table().render(Format::Json)).unwrap();
        assert_eq!(json["rows"][0]["PSNR"], 12.3456);
        assert_eq!(json["rows"][0]["LPIPS"], "no weights");
        assert_eq!(json["rows"][1]["PSNR"], "infinite");
    }

    #[test]
    fn cells_are_found_by_row_and_column() {
        let table = table();
        assert_eq!(table.cell("d", "LPIPS").and_then(Cell::number), Some(1.23e-7));
        assert_eq!(table.cell("d", "D"), None);
        assert!(table.columns[1].published && !table.columns[2].published);
    }
}
