//! `consistency`: are latents that are far apart panoramas that are far apart?
//!
//! Pairs of random latents are decoded; the measure is Spearman's rank correlation between the mean squared difference of
//! their coordinates and that of their log radiance (all pixels alike, as in the paper; by solid angle beside it). Latents
//! are drawn from N(0, 1) as in the paper, and, beside it, from the model's own prior, whose draws look like skies.

use serde_json::json;

use super::work::Work;
use super::{Evaluation, Report};
use crate::canonical::Canonical;
use crate::figure::{Axis, Plot, Series};
use crate::store::Key;
use crate::table::{Cell, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_data::Part;
use veni_image::metrics::{log_error, spearman, weighted_log_error};
use veni_light::latent::Latent;
use veni_light::random::{Purpose, stream};

/// Pairs that are decoded and kept together.
const BATCH: usize = 50;

/// Where latents come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Standard,
    Prior,
}

/// Table: correlation per model and source of latents; a scatter plot per model.
///
/// # Errors
/// [`Error::Invalid`] for fewer than 3 pairs; otherwise as decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let pairs = pairs(run)?;
    let mut report = Report::default();
    let columns = [
        "System",
        "D",
        "*Spearman, N(0, 1)",
        "N(0, 1), by solid angle",
        "own prior",
        "own prior, by solid angle",
    ];
    let mut table = Table::new("consistency", "Consistency of latent and image distances", &columns);
    for subject in run.subjects {
        let standard = distances(run, subject, Source::Standard, pairs).all(run)?.concat();
        let own = if subject.model().has_prior() {
            Some(distances(run, subject, Source::Prior, pairs).all(run)?.concat())
        } else {
            None
        };
        let cells = |d: Option<&Vec<[f64; 3]>>| {
            [1, 2].map(|k| d.map_or_else(|| Cell::missing("no prior"), |d| correlation(d, k)))
        };
        let first = [Cell::text(subject.name()), Cell::Number(subject.dimension() as f64, 0)];
        table.push(first.into_iter().chain(cells(Some(&standard))).chain(cells(own.as_ref())).collect());
        let series = |name: &str, d: &[[f64; 3]]| Series {
            name: name.to_owned(),
            points: d.iter().map(|[latent, image, _]| [*latent, *image]).collect(),
            joined: false,
        };
        let axes = [Axis::linear("MSE of the latents"), Axis::logarithmic("MSE of log radiance")];
        let mut plot = Plot {
            title: format!("Consistency: {}", subject.name()),
            axes,
            series: vec![series("N(0, 1)", &standard)],
        };
        plot.series.extend(own.as_ref().map(|d| series("own prior", d)));
        run.plot(&format!("consistency-{}", subject.name()), &plot, &mut report)?;
    }
    table.note(format!(
        "Spearman's rank correlation over {pairs} pairs, seed {}; 1 is best.",
        run.settings.seed
    ));
    report.tables = vec![table];
    Ok(report)
}

/// The distances of a share of the blocks of pairs.
///
/// # Errors
/// As [`run`].
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    let pairs = pairs(run)?;
    for subject in run.subjects {
        distances(run, subject, Source::Standard, pairs).keep(run, part)?;
        if subject.model().has_prior() {
            distances(run, subject, Source::Prior, pairs).keep(run, part)?;
        }
    }
    Ok(())
}

/// Of [`standard`] alone.
pub(super) fn keep_standard(run: &Evaluation<'_>, subject: &LoadedModel, part: Part) -> Result<()> {
    distances(run, subject, Source::Standard, pairs(run)?).keep(run, part)
}

fn pairs(run: &Evaluation<'_>) -> Result<usize> {
    let pairs = run.settings.pairs.unwrap_or(if run.settings.quick { 200 } else { 1000 });
    if pairs < 3 {
        return Err(Error::invalid(format!("{pairs} pairs: a rank correlation needs at least 3")));
    }
    Ok(pairs)
}

/// Spearman's correlation for N(0, 1) latents over all pixels alike, the paper's number.
pub(super) fn standard(run: &Evaluation<'_>, subject: &LoadedModel) -> Result<Cell> {
    let distances = distances(run, subject, Source::Standard, pairs(run)?).all(run)?.concat();
    Ok(correlation(&distances, 1))
}

fn correlation(distances: &[[f64; 3]], column: usize) -> Cell {
    let of = |k: usize| distances.iter().map(|d| d[k]).collect::<Vec<_>>();
    spearman(&of(0), &of(column)).map_or_else(|| Cell::missing("undefined"), |r| Cell::Number(r, 3))
}

/// Per block of pairs, for each: the squared difference of latents, of images, and of images by solid angle.
fn distances<'a>(
    run: &Evaluation<'a>,
    subject: &'a LoadedModel,
    source: Source,
    pairs: usize,
) -> Work<'a, Vec<[f64; 3]>> {
    let (grid, seed) = (run.data.grid(), run.settings.seed);
    let label = match source {
        Source::Standard => "standard",
        Source::Prior => "prior",
    };
    let prior = subject.prior();
    let draw = move |pair: usize, slot: u64| -> Latent {
        let mut rng = stream(seed, Purpose::Evaluation, pair as u64, slot);
        match source {
            Source::Standard => {
                let vector = |_| [0; 3].map(|_| rng.normal() as f32);
                Latent::new((0..subject.latent_vectors()).map(vector).collect())
            }
            // exposures differ without any latent differing: they are left out
            Source::Prior => Latent::new(Latent::sample(&prior, &mut rng).vectors),
        }
    };
    let blocks: Vec<_> = (0..pairs).step_by(BATCH).map(|first| first..pairs.min(first + BATCH)).collect();
    let key = |block: &std::ops::Range<usize>| Key {
        protocol: "consistency",
        name: format!("{}-{label}-{}", subject.name(), block.start),
        decides: Canonical::of(json!({
            "model": subject.identity(), "latents": label, "seed": seed,
            "first": block.start, "end": block.end, "grid": [grid.width, grid.height],
        })),
    };
    let keys: Vec<_> = blocks.iter().map(key).collect();
    let task = format!("{}, {BATCH} pairs each", subject.name());
    Work::new("block", task, keys, move |index| {
        let one = |pair: usize| {
            let latents = [draw(pair, 0), draw(pair, 1)];
            let images = subject.decode(grid, &latents)?;
            let [a, b] = latents.map(|z| z.vectors.into_flattened());
            Ok([
                log_error(&a, &b),
                log_error(&images[0], &images[1]),
                weighted_log_error(&images[0], &images[1], grid.height),
            ])
        };
        blocks[index].clone().map(one).collect::<Result<Vec<_>>>()
    })
}
