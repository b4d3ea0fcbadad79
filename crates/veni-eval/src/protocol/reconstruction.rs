//! `reconstruction`: how much of a panorama survives a latent of dimension D.
//!
//! Each panorama is coded by each codec (a model's autoencoder pass: the posterior's mean; its optimised pass: a latent
//! fitted from there; the bases given beside), decoded, and scored under both definitions of the metrics.

use super::quality::{self, Reconstructed, coding, reconstruct};
use super::{Evaluation, Report};
use crate::Result;
use crate::codec::Codec;
use crate::figure::{HEAT_RANGE, LabelledSheet, display, heat};
use crate::table::{Cell, Table};
use veni_data::{Item, Part};

/// Table 1: means per codec; table 2: every panorama; a sheet per system: target, reconstructions, their errors; and of several
/// systems a sheet with the last pass of each side by side.
///
/// # Errors
/// As coding, decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let mut report = Report::default();
    let columns = |first: &[&'static str]| [first, &quality::COLUMNS].concat();
    let mut means = Table::new("reconstruction", "Reconstruction", &columns(&["System", "Pass", "D"]));
    let mut each = Table::new(
        "reconstruction-images",
        "Reconstruction of each panorama",
        &columns(&["Panorama", "System"]),
    );
    let mut columns = Vec::new();
    for subject in run.subjects {
        let codecs = run.codecs(subject);
        let codecs: Vec<&dyn Codec> = codecs.iter().map(|codec| &**codec).collect();
        columns.extend(system(run, subject.name(), &codecs, [&mut means, &mut each], &mut report)?);
    }
    for codec in run.others {
        columns.extend(system(run, codec.system(), &[*codec], [&mut means, &mut each], &mut report)?);
    }
    if columns.len() > 1 {
        run.sheet("reconstruction", &side_by_side(run, &columns), &mut report)?;
    }
    means.note(quality::NOTE);
    means.note(run.optimised_note());
    (report.tables, report.details) = (vec![means], vec![each]);
    Ok(report)
}

/// The codes of a share of the panoramas.
///
/// # Errors
/// As coding and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    keep_models(run, part)?;
    run.others.iter().try_for_each(|codec| coding(run, *codec).keep(run, part))
}

/// The models' own passes.
pub(super) fn keep_models(run: &Evaluation<'_>, part: Part) -> Result<()> {
    for subject in run.subjects {
        run.codecs(subject).iter().try_for_each(|codec| coding(run, &**codec).keep(run, part))?;
    }
    Ok(())
}

/// A system's name, and what it makes of every panorama in its last pass.
type Column = (String, Vec<Vec<f32>>);

/// Rows, a sheet and the last pass of one system.
fn system(
    run: &Evaluation<'_>,
    name: &str,
    codecs: &[&dyn Codec],
    [means, each]: [&mut Table; 2],
    report: &mut Report,
) -> Result<Option<Column>> {
    let mut results = Vec::new();
    for codec in codecs {
        let result = reconstruct(run, *codec)?;
        let first =
            [Cell::text(codec.system()), Cell::text(codec.pass()), Cell::Number(codec.dimension() as f64, 0)];
        means.push(first.into_iter().chain(result.mean.cells()).collect());
        for (item, quality) in run.data.items().iter().zip(&result.each) {
            let label = format!("{}, {}", codec.system(), codec.pass());
            each.push(
                [Cell::text(item.name()), Cell::text(label)].into_iter().chain(quality.cells()).collect(),
            );
        }
        results.push((codec.pass(), result));
    }
    run.sheet(&format!("reconstruction-{name}"), &sheet(run, &results), report)?;
    Ok(results.pop().map(|(_, last)| (name.to_owned(), last.images)))
}

fn side_by_side(run: &Evaluation<'_>, columns: &[Column]) -> LabelledSheet {
    let (grid, items) = (run.data.grid(), run.data.items());
    let titles = columns.iter().map(|(system, _)| system.clone());
    let titles: Vec<_> = std::iter::once("panorama".to_owned()).chain(titles).collect();
    let names: Vec<_> = items.iter().map(Item::name).collect();
    let mut sheet = LabelledSheet::new(grid, &titles, &names);
    for (row, item) in items.iter().enumerate() {
        let images = std::iter::once(item.log_radiance.as_slice())
            .chain(columns.iter().map(|(_, images)| images[row].as_slice()));
        for (column, image) in images.enumerate() {
            sheet.place(column, row, &display(grid, image));
        }
    }
    sheet
}

fn sheet(run: &Evaluation<'_>, results: &[(&str, Reconstructed)]) -> LabelledSheet {
    let (grid, items) = (run.data.grid(), run.data.items());
    let titles =
        results.iter().flat_map(|(pass, _)| [(*pass).to_owned(), format!("error, 0 to {HEAT_RANGE}")]);
    let titles: Vec<_> = std::iter::once("panorama".to_owned()).chain(titles).collect();
    let names: Vec<_> = items.iter().map(Item::name).collect();
    let mut sheet = LabelledSheet::new(grid, &titles, &names);
    for (row, item) in items.iter().enumerate() {
        sheet.place(0, row, &display(grid, &item.log_radiance));
        for (at, (_, result)) in results.iter().enumerate() {
            let image = &result.images[row];
            sheet.place(1 + 2 * at, row, &display(grid, image));
            sheet.place(2 + 2 * at, row, &heat(image, &item.log_radiance));
        }
    }
    sheet
}
