//! `interpolation`: is the way from one panorama to another even?
//!
//! Between the latents of each panorama and the next one (the encoder's; optimised ones for a model without encoder) the
//! latent goes linearly, (1 − t) Z₀ + t Z₁, in equal steps of t. The step of the image is the root mean square difference
//! of log radiance between neighbours; reported is the largest step relative to the mean (1: perfectly even), and the
//! length of the way relative to the direct distance of its ends (1: straight).

use super::quality::{codes, coding};
use super::{Evaluation, Report};
use crate::codec::{Autoencoder, Codec, Optimised, model::latent};
use crate::figure::{Axis, LabelledSheet, Plot, Series, display};
use crate::fitting::FitSettings;
use crate::table::{Cell, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_data::Part;
use veni_image::metrics::log_error;
use veni_light::latent::Latent;

/// The way between two panoramas.
struct Way {
    from: String,
    to: String,
    frames: Vec<Vec<f32>>,
    /// Differences between neighbouring frames.
    steps: Vec<f64>,
    /// Difference of the ends.
    direct: f64,
}

impl Way {
    fn mean(&self) -> f64 {
        self.steps.iter().sum::<f64>() / self.steps.len() as f64
    }

    fn largest(&self) -> f64 {
        self.steps.iter().copied().fold(0.0, f64::max) / self.mean()
    }

    fn detour(&self) -> f64 {
        self.steps.iter().sum::<f64>() / self.direct
    }
}

/// Table 1: means per model; table 2: every pair; per model a sheet of strips and the steps as curves.
///
/// # Errors
/// [`Error::Invalid`] for fewer than two panoramas or three frames; otherwise as coding, decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let (count, frames) = (run.data.len(), run.settings.frames);
    if count < 2 {
        return Err(Error::invalid(format!(
            "interpolation goes from one panorama to another: {count} is too few"
        )));
    }
    if frames < 3 {
        return Err(Error::invalid(format!(
            "{frames} frames: an interpolation needs at least 3, ends included"
        )));
    }
    let mut report = Report::default();
    let columns = [
        "System",
        "D",
        "mean step (RMS log radiance)",
        "*largest step / mean",
        "worst",
        "length / direct distance",
    ];
    let mut means = Table::new("interpolation", "Interpolation between neighbours", &columns);
    let columns = ["From", "To", "System", "mean step", "largest step / mean", "length / direct distance"];
    let mut each = Table::new("interpolation-pairs", "Interpolation of each pair", &columns);
    for subject in run.subjects {
        let ways = ways(run, subject)?;
        let n = ways.len() as f64;
        let mean = |f: &dyn Fn(&Way) -> f64| ways.iter().map(f).sum::<f64>() / n;
        means.push(vec![
            Cell::text(subject.name()),
            Cell::Number(subject.dimension() as f64, 0),
            Cell::Number(mean(&Way::mean), 3),
            Cell::Number(mean(&Way::largest), 2),
            Cell::Number(ways.iter().map(Way::largest).fold(0.0, f64::max), 2),
            Cell::Number(mean(&Way::detour), 2),
        ]);
        for way in &ways {
            let names = [&way.from, &way.to].map(|name| Cell::text(name.as_str()));
            let numbers =
                [Cell::Number(way.mean(), 3), Cell::Number(way.largest(), 2), Cell::Number(way.detour(), 2)];
            each.push(names.into_iter().chain([Cell::text(subject.name())]).chain(numbers).collect());
        }
        draw(run, subject, &ways, &mut report)?;
    }
    means.note(format!("{frames} frames, (1 - t) Z0 + t Z1."));
    (report.tables, report.details) = (vec![means], vec![each]);
    Ok(report)
}

/// The codes of a share of the panoramas.
///
/// # Errors
/// As coding and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    run.subjects.iter().try_for_each(|subject| coding(run, &*codec(run, subject)).keep(run, part))
}

/// What gives the ends their latents.
fn codec<'a>(run: &Evaluation<'a>, subject: &'a LoadedModel) -> Box<dyn Codec + 'a> {
    let fit = FitSettings::thorough(run.data.grid(), run.settings.quick);
    match Autoencoder::new(subject) {
        Some(pass) => Box::new(pass),
        None => Box::new(Optimised::new(subject, fit)),
    }
}

fn ways(run: &Evaluation<'_>, subject: &LoadedModel) -> Result<Vec<Way>> {
    let (grid, frames) = (run.data.grid(), run.settings.frames);
    let latents: Vec<_> =
        codes(run, &*codec(run, subject))?.iter().map(|code| latent(subject, code)).collect();
    let names: Vec<_> = run.data.items().iter().map(veni_data::Item::name).collect();
    let way = |(pair, names): (&[Latent], &[String])| {
        let at = |k: usize| k as f32 / (frames - 1) as f32;
        let between: Vec<_> = (0..frames).map(|k| pair[0].lerp(&pair[1], at(k))).collect::<Result<_>>()?;
        let images = subject.decode(grid, &between)?;
        let difference = |a: &[f32], b: &[f32]| log_error(a, b).sqrt();
        Ok(Way {
            from: names[0].clone(),
            to: names[1].clone(),
            steps: images.windows(2).map(|w| difference(&w[0], &w[1])).collect(),
            direct: difference(&images[0], &images[frames - 1]),
            frames: images,
        })
    };
    latents.windows(2).zip(names.windows(2)).map(way).collect()
}

fn draw(run: &Evaluation<'_>, subject: &LoadedModel, ways: &[Way], report: &mut Report) -> Result<()> {
    let grid = run.data.grid();
    let last = (run.settings.frames - 1) as f64;
    let titles: Vec<_> = (0..run.settings.frames).map(|k| format!("t = {:.2}", k as f64 / last)).collect();
    let names: Vec<_> = ways.iter().map(|way| format!("{} - {}", way.from, way.to)).collect();
    let mut sheet = LabelledSheet::new(grid, &titles, &names);
    for (row, way) in ways.iter().enumerate() {
        for (column, frame) in way.frames.iter().enumerate() {
            sheet.place(column, row, &display(grid, frame));
        }
    }
    run.sheet(&format!("interpolation-{}", subject.name()), &sheet, report)?;
    let series = |way: &Way| Series {
        name: format!("{} - {}", way.from, way.to),
        points: way
            .steps
            .iter()
            .enumerate()
            .map(|(k, s)| [(k as f64 + 0.5) / last, s / way.mean()])
            .collect(),
        joined: true,
    };
    let plot = Plot {
        title: format!("Interpolation: {}", subject.name()),
        axes: [Axis::linear("t"), Axis::linear("step / mean step")],
        series: ways.iter().take(7).map(series).collect(),
    };
    run.plot(&format!("interpolation-steps-{}", subject.name()), &plot, report)
}
