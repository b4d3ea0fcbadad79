//! Every row of [`METADATA`] with values: what a tag does to a file that is otherwise the same.

mod display;
mod exr;
mod files;
mod jpeg;
mod png;
mod radiance;
mod xmp;

use std::collections::BTreeSet;

use super::super::*;

/// A row's format and tag, and what shows that it is treated as it says.
type Case = (&'static str, &'static str, fn());

/// All of them, also behind one that fails.
fn run(cases: &[Case]) {
    let failed = cases.iter().filter(|(.., case)| std::panic::catch_unwind(case).is_err());
    let failed: Vec<_> = failed.map(|(format, tag, _)| format!("{format}: {tag}")).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn exr_rows() {
    run(exr::CASES);
}

#[test]
fn radiance_rows() {
    run(radiance::CASES);
}

#[test]
fn display_rows() {
    run(display::CASES);
}

#[test]
fn jpeg_rows() {
    run(jpeg::CASES);
}

#[test]
fn png_rows() {
    run(png::CASES);
}

#[test]
fn xmp_rows() {
    run(xmp::CASES);
}

/// AVIF has its cases beside its reader, where its files are.
#[test]
fn every_row_has_a_case_and_every_case_a_row() {
    let rows: BTreeSet<_> = METADATA.iter().map(|row| (row.format, row.tag)).collect();
    assert_eq!(rows.len(), METADATA.len(), "a row stands twice");
    let cases = [exr::CASES, radiance::CASES, display::CASES, jpeg::CASES, png::CASES, xmp::CASES].concat();
    let cases: BTreeSet<_> = cases.into_iter().map(|(format, tag, _)| (format, tag)).collect();
    let rows: BTreeSet<_> = rows.into_iter().filter(|(format, _)| *format != "AVIF").collect();
    assert_eq!(cases, rows);
}

/// The table of docs/FORMATS.md.
fn document() -> String {
    let mut table = "| format | tag | what happens | what people see |\n|---|---|---|---|\n".to_owned();
    for Metadata { format, tag, treatment, effect } in METADATA {
        let treatment = format!("{treatment:?}").to_lowercase();
        table.push_str(&format!("| {format} | {tag} | {treatment} | {effect} |\n"));
    }
    table
}

/// `VENI_WRITE_DOCS=1 cargo test -p veni-image --lib the_document` writes it.
#[test]
fn the_document_has_this_table() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/FORMATS.md");
    // a package has no documents beside it
    let Ok(text) = std::fs::read_to_string(path) else { return };
    let (begin, end) = ("<!-- METADATA -->\n", "<!-- end of METADATA -->\n");
    let (before, rest) = text.split_once(begin).expect("the table's beginning");
    let (found, after) = rest.split_once(end).expect("the table's end");
    if std::env::var_os("VENI_WRITE_DOCS").is_some() {
        std::fs::write(path, format!("{before}{begin}{}{end}{after}", document())).unwrap();
        return;
    }
    assert_eq!(found, document(), "docs/FORMATS.md is not what METADATA says: VENI_WRITE_DOCS=1 writes it");
}
