//! `ablations`: what is each part of the model worth?
//!
//! One row per given model: its sizes, reconstruction in both passes, consistency and the encoder's equivariance. The models
//! are the experiment: trained alike but for one part.

use super::quality::{self, Scored, reconstruct};
use super::{Evaluation, Report, consistency, equivariance, reconstruction};
use crate::Result;
use crate::codec::{Autoencoder, Codec, Optimised};
use crate::fitting::FitSettings;
use crate::table::{Cell, Table};
use veni_data::Part;

const COLUMNS: [&str; 13] = [
    "System",
    "D",
    "Encoder parameters",
    "Decoder parameters",
    "*LDR PSNR, autoencoder (ref.)",
    "*SSIM, autoencoder (ref.)",
    "*LPIPS, autoencoder (ref.)",
    "*LDR PSNR, optimised (ref.)",
    "*SSIM, optimised (ref.)",
    "*LPIPS, optimised (ref.)",
    "LDR PSNR, autoencoder (exp.)",
    "Spearman, N(0, 1)",
    "Encoder error, one stripe",
];

/// One table.
///
/// # Errors
/// As `reconstruction` and `consistency`.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let mut table = Table::new("ablations", "Ablations", &COLUMNS);
    for subject in run.subjects {
        let [encoder, decoder] = subject.parameters();
        let pass = Autoencoder::new(subject);
        let pass = pass.map(|codec| reconstruct(run, &codec)).transpose()?.map(|r| r.mean);
        let fit = FitSettings::thorough(run.data.grid(), run.settings.quick);
        let codec = Optimised::new(subject, fit);
        let optimised = reconstruct(run, &codec)?.mean;
        let mut row = vec![
            Cell::text(subject.name()),
            Cell::Number(codec.dimension() as f64, 0),
            Cell::Number(encoder as f64, 0),
            Cell::Number(decoder as f64, 0),
        ];
        row.extend(three(pass.as_ref().map(|q| &q.reference)));
        row.extend(three(Some(&optimised.reference)));
        row.push(pass.map_or_else(no_encoder, |q| Cell::Number(q.exposure.scores.ldr_psnr, 2)));
        row.push(consistency::standard(run, subject)?);
        row.push(equivariance::by_one_stripe(run, subject)?);
        table.push(row);
    }
    table.note(quality::NOTE);
    table.note(run.optimised_note());
    Ok(Report { tables: vec![table], ..Report::default() })
}

/// The share of the work that it has in common with `reconstruction` and `consistency`.
///
/// # Errors
/// As theirs.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    reconstruction::keep_models(run, part)?;
    run.subjects.iter().try_for_each(|subject| consistency::keep_standard(run, subject, part))
}

fn no_encoder() -> Cell {
    Cell::missing("no encoder")
}

fn three(scored: Option<&Scored>) -> [Cell; 3] {
    let Some(s) = scored else { return [(); 3].map(|()| no_encoder()) };
    let lpips = s.lpips.map_or_else(|| Cell::missing("no weights"), |v| Cell::Number(v, 3));
    [Cell::Number(s.scores.ldr_psnr, 2), Cell::Number(s.scores.ssim, 3), lpips]
}
