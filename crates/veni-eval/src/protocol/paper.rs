//! `paper`: every protocol, with published numbers beside ours.
//!
//! The paper's scores of reconstruction are built in, for models of its kind and sizes; the rest comes from a file of
//! the user's, see [`Published`]. Where there is none, the cell says "not available".

use super::published::Published;
use super::{
    Evaluation, Report, ablations, consistency, dataset_size, equivariance, interpolation, inverse_rendering,
    reconstruction, uniqueness,
};
use crate::Result;
use veni_data::Part;

/// All protocols in turn. `dataset-size` is left out, and said to be, unless two models name different sizes.
///
/// # Errors
/// As each protocol and [`Published::beside`].
pub fn run(run: &Evaluation<'_>, published: &Published) -> Result<Report> {
    let mut report = Report::default();
    let published = &published.clone().with_article(run.subjects);
    let protocols: [fn(&Evaluation<'_>) -> Result<Report>; 7] = [
        reconstruction::run,
        uniqueness::run,
        consistency::run,
        interpolation::run,
        equivariance::run,
        ablations::run,
        inverse_rendering::run,
    ];
    for protocol in protocols {
        add(&mut report, protocol(run)?, published)?;
    }
    if let Some(first) = report.tables.first_mut() {
        first.note("Published numbers are those of the papers' test panoramas, not of these.");
    }
    let mut sizes: Vec<_> = run.subjects.iter().map(super::LoadedModel::training_panoramas).collect();
    let all_known = sizes.iter().all(Option::is_some);
    sizes.sort();
    sizes.dedup();
    if all_known && sizes.len() > 1 {
        add(&mut report, dataset_size::run(run)?, published)?;
    } else if let Some(first) = report.tables.first_mut() {
        first.note("No table of training set sizes: it needs models that were trained on different numbers of panoramas.");
    }
    Ok(report)
}

/// The share of every protocol that keeps anything; what the others need is among it.
///
/// # Errors
/// As theirs.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    reconstruction::keep(run, part)?;
    uniqueness::keep(run, part)?;
    consistency::keep(run, part)?;
    inverse_rendering::keep(run, part)
}

/// The protocol's answer gets published numbers beside it.
fn add(report: &mut Report, mut part: Report, published: &Published) -> Result<()> {
    for table in &mut part.tables {
        *table = published.beside(table)?;
    }
    report.tables.append(&mut part.tables);
    report.details.append(&mut part.details);
    report.figures.append(&mut part.figures);
    Ok(())
}
