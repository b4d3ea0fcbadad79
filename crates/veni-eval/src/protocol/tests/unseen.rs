//! `photo` and `completion`: a tiny model, skies, and the same skies as training panoramas.

use super::*;
use crate::protocol::{completion, photo};

/// The same skies by other names.
fn known(data: &Dataset) -> Dataset {
    let renamed = |item: &Item| Item { path: item.path.with_extension("hdr"), ..item.clone() };
    Dataset::new(GRID, data.items().iter().map(renamed).collect())
}

fn with<'a>(run: &Evaluation<'a>, train: &'a Dataset) -> Evaluation<'a> {
    Evaluation { train: Some(train), ..*run }
}

fn columns(table: &Table, title: &str) -> usize {
    table.columns.iter().position(|c| c.title == title).unwrap()
}

#[test]
fn photographs_of_known_skies_have_these_as_their_nearest() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(2), [subject("tiny", 1)]);
    let train = known(&data);
    let run =
        || evaluated(folder.path(), &subjects, &data, quick(), |run| photo::run(&with(run, &train)).unwrap());
    let (first, computed) = run();
    // of two panoramas four photographs each are fitted, and judged
    assert_eq!(computed, 16);
    let (again, computed) = run();
    assert_eq!((computed, &again.tables, &again.details), (8, &first.tables, &first.details));
    let table = &first.tables[0];
    let names: Vec<_> = table.rows.iter().map(|r| r[0].clone()).collect();
    assert_eq!(names, ["tiny", "mean of training", "nearest of training"].map(Cell::text));
    // looked at the same way, so nothing is left to differ: light, colours, exposure
    for column in ["E error", "worst", "white known", "Diffuse, si-RMSE", "Mirror, si-RMSE", "°"] {
        let value = number(table, "nearest of training", column);
        assert!(value < 2e-3, "{column}: {value}");
        assert!(number(table, "mean of training", column) > 0.02, "{column}: {table:?}");
    }
    assert!(number(table, "tiny", "E error").is_finite());
    let each = &first.details[0];
    let nearest = |row: &Vec<Cell>| row[columns(each, "Nearest")].clone();
    assert_eq!(each.rows.len(), 24);
    assert_eq!(nearest(&each.rows[0]), Cell::text("sky-0, 0°"));
    assert_eq!(nearest(&each.rows[7]), Cell::text("sky-1, 270°"));
    assert!(first.figures.len() == 4 && first.figures.iter().all(|f| image::open(f).is_ok()));
}

#[test]
fn hidden_halves_are_scored_beside_the_mean_sky() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(2), [subject("tiny", 1)]);
    let train = known(&skies(5));
    let run = || {
        evaluated(folder.path(), &subjects, &data, quick(), |run| {
            completion::run(&with(run, &train)).unwrap()
        })
    };
    let (first, computed) = run();
    assert_eq!(computed, 4, "two panoramas, two halves");
    let (again, computed) = run();
    assert_eq!((computed, &again.tables), (0, &first.tables));
    let table = &first.tables[0];
    assert_eq!((table.rows.len(), first.details[0].rows.len(), first.figures.len()), (4, 8, 2));
    let (psnr, error) = (columns(table, "LDR PSNR"), columns(table, "E error"));
    for row in &table.rows {
        let (psnr, error) = (row[psnr].number().unwrap(), row[error].number().unwrap());
        assert!((3.0..60.0).contains(&psnr) && (0.0..2.0).contains(&error), "{row:?}");
    }
}

#[test]
fn training_panoramas_are_needed_and_are_others() {
    let (folder, data, subjects) = (tempfile::tempdir().unwrap(), skies(1), [subject("tiny", 1)]);
    let refused = |protocol: fn(&Evaluation<'_>) -> Result<Report>, train: Option<&Dataset>| {
        let run = |run: &Evaluation<'_>| protocol(&Evaluation { train, ..*run }).unwrap_err().to_string();
        evaluated(folder.path(), &subjects, &data, quick(), run).0
    };
    for protocol in [photo::run, completion::run] {
        assert!(refused(protocol, None).contains("training panoramas"));
        let message = refused(protocol, Some(&data));
        assert!(message.contains("sky-0.exr") && message.contains("judged"), "{message}");
    }
}
