//! `equivariance`: does the latent rotate with the panorama, and the decoded panorama with the latent?
//!
//! - Encoder: |Z(rotated image) − rotated Z(image)|/|Z|, for rotations by whole stripes, by half a stripe, and for the mirror
//!   image; the worst and the mean over panoramas.
//! - Decoder: the largest difference of log radiance between the rotated (mirrored) latent in rotated (mirrored) directions
//!   and the latent itself, over latents, 36 angles and a 64 × 32 grid.
//! - Whole model: panorama rotated by five stripes, encoded, decoded, against the reconstruction rotated by five stripes.

use std::f64::consts::TAU;

use burn::tensor::{Tensor, TensorData};

use super::{Evaluation, Report};
use crate::Result;
use crate::figure::{Axis, Plot, Series};
use crate::table::{Cell, Table};
use veni_core::LoadedModel;
use veni_data::augment::{mirror, rotate_columns};
use veni_data::parallel::parallel;
use veni_light::latent::{Latent, Prior};
use veni_light::sphere::Equirect;

/// Latents that stand for all where there is no encoder to give some.
const DRAWN: u64 = 4;
/// Why a stripe cannot be rotated by.
const NARROW: &str = "stripes are not a whole number of pixels";

/// Table: one row per measure, one column per model; per model with an encoder the error over the angle as a curve.
///
/// # Errors
/// As encoding, decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let mut report = Report::default();
    let names: Vec<_> = run.subjects.iter().map(LoadedModel::name).collect();
    let mut table =
        Table::new("equivariance", "Errors of equivariance", &[&["Measure"], names.as_slice()].concat());
    let mut columns: Vec<Vec<(&'static str, Cell)>> = Vec::new();
    let mut curves = Vec::new();
    for subject in run.subjects {
        run.observer.begin("part", subject.name(), 0, 2);
        let (encoder, curve) = encoder(run, subject)?;
        run.observer.advance(1);
        curves.extend(curve);
        columns.push(encoder.into_iter().chain(decoder(run, subject)?).collect());
        run.observer.advance(1);
    }
    let measures = columns.first().map_or(0, Vec::len);
    for row in 0..measures {
        let cells = columns.iter().map(|column| column[row].1.clone());
        table.push(std::iter::once(Cell::text(columns[0][row].0)).chain(cells).collect());
    }
    table.note(
        "Encoder: relative error of the latent. Decoder and whole model: largest difference of log radiance. A stripe is \
         the part of the panorama that becomes one token.",
    );
    report.tables = vec![table];
    if !curves.is_empty() {
        let axes =
            [Axis::linear("rotation in stripes"), Axis::logarithmic("relative error of the latent (mean)")];
        let plot = Plot { title: "Equivariance of the encoder".to_owned(), axes, series: curves };
        run.plot("equivariance", &plot, &mut report)?;
    }
    Ok(report)
}

/// Mean relative error of the latent over panoramas rotated by one stripe, if there is an encoder and a stripe is a whole
/// number of columns.
pub(super) fn by_one_stripe(run: &Evaluation<'_>, subject: &LoadedModel) -> Result<Cell> {
    Ok(match Encoding::of(run, subject)? {
        None => Cell::missing("no encoder"),
        Some(encoding) if encoding.stripe == 0 => Cell::missing(NARROW),
        Some(encoding) => Cell::Scientific(mean(&encoding.rotated(encoding.stripe)?)),
    })
}

/// A model's latents of all panoramas as they are.
struct Encoding<'a> {
    subject: &'a LoadedModel,
    grid: Equirect,
    images: Vec<&'a [f32]>,
    latents: Vec<Latent>,
    /// Columns per stripe; 0 if that is not a whole number.
    stripe: usize,
}

impl<'a> Encoding<'a> {
    fn of(run: &Evaluation<'a>, subject: &'a LoadedModel) -> Result<Option<Self>> {
        let Some(stripes) = subject.stripes()? else { return Ok(None) };
        let grid = run.data.grid();
        let images: Vec<_> = run.data.items().iter().map(|item| item.log_radiance.as_slice()).collect();
        let latents = subject.encode(grid, &images)?;
        let whole = grid.width.is_multiple_of(stripes.stripes());
        let stripe = if whole { grid.width / stripes.stripes() } else { 0 };
        Ok(Some(Self { subject, grid, images, latents, stripe }))
    }

    /// Relative errors of the latents when every panorama is changed and every latent is expected to change.
    fn errors(&self, change: impl Fn(&mut [f32]), expected: impl Fn(&Latent) -> Latent) -> Result<Vec<f64>> {
        let changed: Vec<_> = self.images.iter().map(|image| with(image, &change)).collect();
        let changed: Vec<_> = changed.iter().map(Vec::as_slice).collect();
        let latents = self.subject.encode(self.grid, &changed)?;
        Ok(latents.iter().zip(&self.latents).map(|(z, base)| relative(z, &expected(base))).collect())
    }

    fn rotated(&self, columns: usize) -> Result<Vec<f64>> {
        let angle = -TAU * columns as f64 / self.grid.width as f64;
        self.errors(|image| rotate_columns(self.grid, image, columns), |z| z.rotated(angle))
    }
}

type Measures = Vec<(&'static str, Cell)>;

fn encoder(run: &Evaluation<'_>, subject: &LoadedModel) -> Result<(Measures, Option<Series>)> {
    let names = [
        ["encoder, one stripe, worst", "encoder, one stripe, mean"],
        ["encoder, rotated by 90°, worst", "encoder, rotated by 90°, mean"],
        ["encoder, half a stripe, worst", "encoder, half a stripe, mean"],
        ["encoder, mirrored, worst", "encoder, mirrored, mean"],
    ];
    const WHOLE: &str = "whole model, five stripes";
    let Some(encoding) = Encoding::of(run, subject)? else {
        let missing = || Cell::missing("no encoder");
        return Ok((
            names.as_flattened().iter().chain([&WHOLE]).map(|name| (*name, missing())).collect(),
            None,
        ));
    };
    let (grid, stripe) = (encoding.grid, encoding.stripe);
    let pair = |errors: Option<Vec<f64>>, why: &str| match errors {
        Some(errors) => [worst(&errors), mean(&errors)].map(Cell::Scientific),
        None => [(); 2].map(|()| Cell::missing(why)),
    };
    let rotated = |columns: usize, possible: bool| possible.then(|| encoding.rotated(columns)).transpose();
    let cells = [
        pair(rotated(stripe, stripe > 0)?, NARROW),
        pair(rotated(grid.width / 4, stripe > 0 && grid.width.is_multiple_of(4 * stripe))?, NARROW),
        pair(
            rotated(stripe / 2, stripe > 1 && stripe.is_multiple_of(2))?,
            "half a stripe is not a whole number of pixels",
        ),
        pair(Some(encoding.errors(|image| mirror(grid, image), Latent::mirrored)?), ""),
    ];
    let mut measures: Measures =
        names.as_flattened().iter().copied().zip(cells.into_iter().flatten()).collect();
    measures.push((WHOLE, if stripe > 0 { whole_model(&encoding)? } else { Cell::missing(NARROW) }));
    let mut points = Vec::new();
    for columns in 1..=(4 * stripe).min(grid.width - 1) {
        points.push([columns as f64 / stripe as f64, mean(&encoding.rotated(columns)?)]);
    }
    Ok((measures, Some(Series { name: subject.name().to_owned(), points, joined: true })))
}

fn whole_model(encoding: &Encoding<'_>) -> Result<Cell> {
    let (grid, columns) = (encoding.grid, 5 * encoding.stripe % encoding.grid.width);
    let rotate = |image: &[f32]| with(image, |image| rotate_columns(grid, image, columns));
    let rotated: Vec<_> = encoding.images.iter().map(|image| rotate(image)).collect();
    let rotated: Vec<_> = rotated.iter().map(Vec::as_slice).collect();
    let again = encoding.subject.decode(grid, &encoding.subject.encode(grid, &rotated)?)?;
    let once = encoding.subject.decode(grid, &encoding.latents)?;
    let largest = again.iter().zip(&once).map(|(a, b)| largest(a, &rotate(b)));
    Ok(Cell::Scientific(largest.fold(0.0, f64::max)))
}

fn decoder(run: &Evaluation<'_>, subject: &LoadedModel) -> Result<Measures> {
    let latents = match Encoding::of(run, subject)? {
        Some(encoding) => encoding.latents,
        None => {
            let prior = Prior::standard(subject.latent_vectors());
            (0..DRAWN)
                .map(|k| Latent::new(Latent::from_seed(&prior, run.settings.seed + k).vectors))
                .collect()
        }
    };
    let rotated = parallel(36, |step| {
        let angle = 0.01 + TAU * step as f64 / 36.0;
        let (sin, cos) = angle.sin_cos();
        against(
            subject,
            &latents,
            |z| z.rotated(angle),
            |[x, y, z]| {
                let (x, y) = (f64::from(x), f64::from(y));
                [(x * cos - y * sin) as f32, (x * sin + y * cos) as f32, z]
            },
        )
    })?;
    let mirrored = against(subject, &latents, Latent::mirrored, |[x, y, z]| [x, -y, z])?;
    Ok(vec![
        ("decoder, rotated", Cell::Scientific(worst(&rotated))),
        ("decoder, mirrored", Cell::Scientific(mirrored)),
    ])
}

/// The largest difference between latents in directions, and moved latents in moved directions.
fn against(
    subject: &LoadedModel,
    latents: &[Latent],
    latent: impl Fn(&Latent) -> Latent,
    direction: impl Fn([f32; 3]) -> [f32; 3],
) -> Result<f64> {
    let directions = Equirect::new(64, 32).directions();
    let moved: Vec<_> = directions.iter().map(|d| direction(*d)).collect();
    let mut worst = 0f64;
    for z in latents {
        let (a, b) = (evaluate(subject, z, &directions)?, evaluate(subject, &latent(z), &moved)?);
        worst = worst.max(largest(&a, &b));
    }
    Ok(worst)
}

fn evaluate(subject: &LoadedModel, latent: &Latent, directions: &[[f32; 3]]) -> Result<Vec<f32>> {
    if let Some(field) = subject.field() {
        let mut values = vec![[0.0; 3]; directions.len()];
        field.condition(latent)?.log_radiance_batch(directions, &mut values);
        return Ok(values.into_flattened());
    }
    let network = subject.network();
    let device = subject.device();
    let tensor = |values: &[f32], shape: [usize; 2]| TensorData::new(values.to_vec(), shape);
    let z = Tensor::<2>::from_data(tensor(latent.vectors.as_flattened(), [latent.vectors.len(), 3]), device);
    let d = Tensor::<2>::from_data(tensor(directions.as_flattened(), [directions.len(), 3]), device);
    let values = network.forward(z.unsqueeze(), d).into_data().convert::<f32>();
    Ok(values.try_into_vec().expect("just converted to f32"))
}

fn with(image: &[f32], change: impl Fn(&mut [f32])) -> Vec<f32> {
    let mut image = image.to_vec();
    change(&mut image);
    image
}

fn relative(z: &Latent, expected: &Latent) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f32>| v.map(|x| f64::from(x).powi(2)).sum::<f64>().sqrt();
    let (a, b) = (z.vectors.as_flattened(), expected.vectors.as_flattened());
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut a.iter().copied())
}

fn largest(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

fn worst(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

fn mean(errors: &[f64]) -> f64 {
    errors.iter().sum::<f64>() / errors.len() as f64
}
