//! `uniqueness`: do two fits of one panorama, from two random starts, end in the same place of latent space?
//!
//! Per panorama two latents are fitted from N(0, 1) with the reference's helper (mean squared log error over all pixels;
//! learning rate 1e-2 → 2e-3 for auto-encoders, 1e-1 → 1e-3 for auto-decoders). If both are the same code, or lie in one
//! basin, the midpoint decodes to the same image: the measure is the mean squared difference of log radiance between the
//! decoded first latent and the decoded midpoint ½(Z₁ + Z₂). Lower is better; the fits' own errors stand beside it.

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::work::{Work, images};
use super::{Evaluation, Report};
use crate::canonical::Canonical;
use crate::figure::{LabelledSheet, display, heat};
use crate::fitting::FitSettings;
use crate::store::Key;
use crate::table::{Cell, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_data::Part;
use veni_image::metrics::{log_error, weighted_log_error};
use veni_light::digest::Digest;
use veni_light::latent::Latent;
use veni_light::model::ModelKind;
use veni_light::random::{Purpose, stream};

/// Both latents of a panorama.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Pair {
    first: Vec<[f32; 3]>,
    second: Vec<[f32; 3]>,
}

/// What is said of one panorama.
struct Measured {
    /// Mean squared difference of log radiance between first and midpoint, and weighted by solid angle.
    midpoint: [f64; 2],
    /// Mean squared log error of both fits.
    fits: [f64; 2],
    /// Root mean square difference of the latents' coordinates.
    distance: f64,
}

/// Table 1: means per model; table 2: every panorama; a sheet per model: target, both fits, the midpoint and its error.
///
/// # Errors
/// As fitting, decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let mut report = Report::default();
    let columns = [
        "System",
        "D",
        "*MSE first to midpoint",
        "the same by solid angle",
        "largest",
        "MSE of the fits",
        "latent distance (RMS)",
    ];
    let mut means = Table::new("uniqueness", "Uniqueness: two fits from random starts", &columns);
    let columns = [
        "Panorama",
        "System",
        "MSE first to midpoint",
        "the same by solid angle",
        "MSE of fit 1",
        "MSE of fit 2",
        "latent distance (RMS)",
    ];
    let mut each = Table::new("uniqueness-images", "Uniqueness of each panorama", &columns);
    for subject in run.subjects {
        let pairs = pairs(run, subject).all(run)?;
        let measured = measure(run, subject, &pairs, &mut report)?;
        for (item, m) in run.data.items().iter().zip(&measured) {
            let numbers = [m.midpoint[0], m.midpoint[1], m.fits[0], m.fits[1]].map(Cell::Scientific);
            let first = [Cell::text(item.name()), Cell::text(subject.name())];
            each.push(first.into_iter().chain(numbers).chain([Cell::Number(m.distance, 3)]).collect());
        }
        let n = measured.len() as f64;
        let mean = |f: &dyn Fn(&Measured) -> f64| measured.iter().map(f).sum::<f64>() / n;
        means.push(vec![
            Cell::text(subject.name()),
            Cell::Number(subject.dimension() as f64, 0),
            Cell::Scientific(mean(&|m| m.midpoint[0])),
            Cell::Scientific(mean(&|m| m.midpoint[1])),
            Cell::Scientific(measured.iter().map(|m| m.midpoint[0]).fold(f64::NEG_INFINITY, f64::max)),
            Cell::Scientific(mean(&|m| 0.5 * (m.fits[0] + m.fits[1]))),
            Cell::Number(mean(&|m| m.distance), 3),
        ]);
        means.note(format!(
            "{}: {}, seed {}.",
            subject.name(),
            fit(run, subject).describe(),
            run.settings.seed
        ));
    }
    (report.tables, report.details) = (vec![means], vec![each]);
    Ok(report)
}

/// The fits of a share of the panoramas.
///
/// # Errors
/// As fitting and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    run.subjects.iter().try_for_each(|subject| pairs(run, subject).keep(run, part))
}

/// The reference implementation's rates for the two kinds of models.
fn fit(run: &Evaluation<'_>, subject: &LoadedModel) -> FitSettings {
    let rates = match subject.kind() {
        ModelKind::Veni => [1e-2, 2e-3],
        ModelKind::Reni => [1e-1, 1e-3],
    };
    FitSettings::reference(run.data.grid(), rates, run.settings.quick)
}

fn pairs<'a>(run: &Evaluation<'a>, subject: &'a LoadedModel) -> Work<'a, Pair> {
    let (grid, items, fit) = (run.data.grid(), run.data.items(), fit(run, subject));
    let seed = run.settings.seed;
    let identities = images(run);
    let keys: Vec<_> = items
        .iter()
        .zip(&identities)
        .map(|(item, image)| Key {
            protocol: "uniqueness",
            name: format!("{}-{}", item.name(), subject.name()),
            decides: Canonical::of(json!({
                "model": subject.identity(), "fit": fit.key(), "seed": seed, "image": image,
            })),
        })
        .collect();
    let task = format!("{}, two fits", subject.name());
    Work::new("panorama", task, keys, move |i| {
        let start = [0, 1].map(|slot| random(subject.latent_vectors(), seed, &identities[i], slot));
        let fitted = fit.fit(subject, grid, &[items[i].log_radiance.as_slice(); 2], &start);
        let fitted = fitted.map_err(|e| Error::invalid(format!("{}: {e}", subject.name())))?;
        let mut vectors = fitted.latents.into_iter().map(|z| z.vectors);
        let mut next = || vectors.next().ok_or_else(|| Error::invalid("the fit gave fewer than two latents"));
        Ok(Pair { first: next()?, second: next()? })
    })
}

/// A latent from N(0, 1) that depends on the panorama itself, not on its place in the set.
fn random(n: usize, seed: u64, image: &serde_json::Value, slot: u64) -> Latent {
    let step = Digest::of(image.to_string()).number();
    let mut rng = stream(seed, Purpose::Evaluation, step, slot);
    Latent::new((0..n).map(|_| [0; 3].map(|_| rng.normal() as f32)).collect())
}

fn measure(
    run: &Evaluation<'_>,
    subject: &LoadedModel,
    pairs: &[Pair],
    report: &mut Report,
) -> Result<Vec<Measured>> {
    let (grid, items) = (run.data.grid(), run.data.items());
    let titles = ["panorama", "first fit", "second fit", "midpoint", "first - midpoint"].map(str::to_owned);
    let names: Vec<_> = items.iter().map(veni_data::Item::name).collect();
    let mut sheet = LabelledSheet::new(grid, &titles, &names);
    let mut measured = Vec::with_capacity(pairs.len());
    for (row, (item, pair)) in items.iter().zip(pairs).enumerate() {
        let (first, second) = (Latent::new(pair.first.clone()), Latent::new(pair.second.clone()));
        let midpoint = first.lerp(&second, 0.5)?;
        let distance = log_error(first.vectors.as_flattened(), second.vectors.as_flattened()).sqrt();
        let decoded = subject.decode(grid, &[first, second, midpoint])?;
        let (a, b, middle) = (&decoded[0], &decoded[1], &decoded[2]);
        let target = item.log_radiance.as_slice();
        measured.push(Measured {
            midpoint: [log_error(a, middle), weighted_log_error(a, middle, grid.height)],
            fits: [log_error(a, target), log_error(b, target)],
            distance,
        });
        for (column, image) in [target, a, b, middle].into_iter().enumerate() {
            sheet.place(column, row, &display(grid, image));
        }
        sheet.place(4, row, &heat(a, middle));
    }
    run.sheet(&format!("uniqueness-{}", subject.name()), &sheet, report)?;
    Ok(measured)
}
