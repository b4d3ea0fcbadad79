//! `dataset-size`: what is more training data worth?
//!
//! Reconstruction of the same panoramas by models that were trained on different numbers of panoramas. The number is the
//! one in the model file; models of one D are joined to a curve.

use super::quality::{self, reconstruct};
use super::{Evaluation, Report, reconstruction};
use crate::figure::{Axis, Plot, Series};
use crate::table::{Cell, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_data::Part;

/// Table: reconstruction per number of training panoramas; LDR PSNR (exposure) as curves.
///
/// # Errors
/// [`Error::Invalid`] if a model does not say on how many panoramas it was trained; otherwise as `reconstruction`.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let mut subjects = Vec::new();
    for subject in run.subjects {
        let size = subject.training_panoramas().ok_or_else(|| {
            Error::invalid(
                "its file does not say on how many panoramas it was trained; leave this model out, or train it again: a \
                 training run records it",
            )
            .in_file(subject.name())
        })?;
        subjects.push((size, subject));
    }
    subjects.sort_by_key(|(size, subject)| (subject.dimension(), *size));
    let mut report = Report::default();
    let first = ["System", "Training panoramas", "D", "Pass"];
    let columns = [&first[..], &quality::COLUMNS].concat();
    let mut table = Table::new("dataset-size", "Reconstruction by size of the training set", &columns);
    let mut series: Vec<Series> = Vec::new();
    for (size, subject) in subjects {
        for codec in run.codecs(subject) {
            let mean = reconstruct(run, &*codec)?.mean;
            let first = [
                Cell::text(subject.name()),
                Cell::Number(size as f64, 0),
                Cell::Number(subject.dimension() as f64, 0),
                Cell::text(codec.pass()),
            ];
            table.push(first.into_iter().chain(mean.cells()).collect());
            let name = curve(subject, codec.pass());
            let point = [size as f64, mean.exposure.scores.ldr_psnr];
            match series.iter_mut().find(|s| s.name == name) {
                Some(known) => known.points.push(point),
                None => series.push(Series { name, points: vec![point], joined: true }),
            }
        }
    }
    table.note(quality::NOTE);
    table.note(run.optimised_note());
    let axes = [Axis::logarithmic("training panoramas"), Axis::linear("LDR PSNR, dB (exposure)")];
    run.plot(
        "dataset-size",
        &Plot { title: "What more training data is worth".to_owned(), axes, series },
        &mut report,
    )?;
    report.tables = vec![table];
    Ok(report)
}

/// The codes of a share of the panoramas.
///
/// # Errors
/// As coding and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    reconstruction::keep_models(run, part)
}

fn curve(subject: &LoadedModel, pass: &str) -> String {
    format!("D = {}, {pass}", subject.dimension())
}
