//! Published numbers of the papers, to compare with.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::table::{Cell, Column, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_light::model::ModelKind;

/// LDR PSNR of VENI's reconstructions by D, autoencoder pass and optimised (arXiv 2601.14079).
const VENI_LDR_PSNR: [(usize, [f64; 2]); 3] =
    [(27, [18.78, 20.33]), (147, [19.40, 21.89]), (300, [19.47, 22.68])];

/// Largest file of published numbers that is read.
const MAX_BYTES: u64 = 1 << 20;

/// Numbers from the paper: JSON `{table: {row: {column: number}}}`. A row is named as in our table: by the system, and
/// in reconstruction by "system, pass".
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct Published(BTreeMap<String, BTreeMap<String, BTreeMap<String, f64>>>);

impl Published {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read, [`Error::Invalid`] by name if it is not such JSON.
    pub fn load(path: &Path) -> Result<Self> {
        let size = std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?.len();
        if size > MAX_BYTES {
            return Err(Error::too_large("too large for a file of published numbers").in_file(path));
        }
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
        let text = veni_light::text::decode(bytes).map_err(|e| e.in_file(path))?;
        serde_json::from_str(&text).map_err(|e| {
            Error::invalid(format!("no published numbers, {{table: {{row: {{column: number}}}}}} ({e})"))
                .in_file(path)
        })
    }

    /// Together with what the papers say of systems like these, where the file says nothing else.
    #[must_use]
    pub fn with_article(mut self, subjects: &[LoadedModel]) -> Self {
        for subject in subjects {
            let known = VENI_LDR_PSNR.iter().find(|(d, _)| *d == subject.dimension());
            let is_veni = subject.kind() == ModelKind::Veni && subject.veni().is_some();
            let Some((_, scores)) = known.filter(|_| is_veni) else { continue };
            let rows = self.0.entry("reconstruction".into()).or_default();
            for (pass, score) in ["autoencoder", "optimised"].into_iter().zip(scores) {
                let row = rows.entry(format!("{}, {pass}", subject.name())).or_default();
                row.entry("LDR PSNR (ref.)".into()).or_insert(*score);
            }
        }
        self
    }

    /// The same table with a column "published" after each column of numbers that the papers print.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming a row or column of the published table that ours does not have.
    pub fn beside(&self, table: &Table) -> Result<Table> {
        let empty = BTreeMap::new();
        let published = self.0.get(&table.name).unwrap_or(&empty);
        let mut wide = Table { columns: Vec::new(), rows: Vec::new(), ..table.clone() };
        for column in &table.columns {
            wide.columns.push(column.clone());
            if column.published {
                wide.columns.push(Column { title: format!("{}, published", column.title), published: false });
            }
        }
        let mut known = Vec::new();
        for row in &table.rows {
            let name = row_name(table, row);
            let mut cells = Vec::new();
            for (column, cell) in table.columns.iter().zip(row) {
                cells.push(cell.clone());
                if column.published {
                    let value = published.get(&name).and_then(|row| row.get(&column.title));
                    cells.push(match value {
                        Some(value) => Cell::Number(*value, 3),
                        None => Cell::missing("not available"),
                    });
                }
            }
            wide.rows.push(cells);
            known.push(name);
        }
        let titles: Vec<_> = table.columns.iter().filter(|c| c.published).map(|c| c.title.as_str()).collect();
        for (row, cells) in published {
            let column = cells.keys().find(|c| !titles.contains(&c.as_str()));
            if !known.contains(row) || column.is_some() {
                let what = column
                    .filter(|_| known.contains(row))
                    .map_or_else(|| format!("row {row}"), |c| format!("column {c}"));
                return Err(Error::invalid(format!(
                    "published numbers: table {} has no {what}; its rows are {}, its columns {}",
                    table.name,
                    known.join("; "),
                    titles.join("; ")
                )));
            }
        }
        Ok(wide)
    }
}

/// The first cell, with the pass where there is one.
fn row_name(table: &Table, row: &[Cell]) -> String {
    let text = |title: &str| {
        let at = table.columns.iter().position(|c| c.title == title)?;
        match &row[at] {
            Cell::Text(text) => Some(text.as_str()),
            _ => None,
        }
    };
    let first = match &row[0] {
        Cell::Text(text) => text.clone(),
        _ => String::new(),
    };
    text("Pass").map_or(first.clone(), |pass| format!("{first}, {pass}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("reconstruction", "t", &["System", "Pass", "*PSNR", "SSIM"]);
        for pass in ["autoencoder", "optimised"] {
            table.push(vec![
                Cell::text("VENI"),
                Cell::text(pass),
                Cell::Number(1.0, 1),
                Cell::Number(2.0, 1),
            ]);
        }
        table
    }

    fn published(json: &str) -> Published {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn published_numbers_stand_beside_ours_or_are_said_to_be_missing() {
        let numbers = published(r#"{"reconstruction": {"VENI, optimised": {"PSNR": 21.5}}}"#);
        let wide = numbers.beside(&table()).unwrap();
        assert_eq!(wide.columns.len(), 5);
        assert_eq!(wide.columns[3].title, "PSNR, published");
        assert_eq!(wide.rows[0][3], Cell::missing("not available"));
        assert_eq!(wide.rows[1][3], Cell::Number(21.5, 3));
        assert_eq!(wide.rows[1][4], Cell::Number(2.0, 1));
    }

    #[test]
    fn what_no_table_has_is_refused() {
        for (json, word) in [
            (r#"{"reconstruction": {"VENI": {"PSNR": 1}}}"#, "row VENI"),
            (r#"{"reconstruction": {"VENI, optimised": {"SSIM": 1}}}"#, "column SSIM"),
        ] {
            let message = published(json).beside(&table()).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("VENI, autoencoder"), "{message}");
        }
    }
}
