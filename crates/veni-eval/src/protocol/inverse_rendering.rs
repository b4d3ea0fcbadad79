//! `inverse-rendering`: what the rendered image of a ball tells of the light on it, from dull to mirror-like.
//!
//! Per panorama and K_s a white ball of Blinn-Phong reflectance is rendered under the panorama itself (physically, without
//! shadows); a latent and an exposure are fitted to that picture alone, from latent 0; and the decoded light is
//! compared with the panorama. A dull ball shows little more than the first few harmonics of the light: the rest is
//! the prior's.

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::quality::{self, Quality, rate};
use super::work::{Work, images};
use super::{Evaluation, Report};
use crate::canonical::Canonical;
use crate::figure::{Axis, LabelledSheet, Plot, Series, display};
use crate::store::Key;
use crate::table::{Cell, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_core::fit::{FitConfig, FitResult, fit_rendered, matching_exposure};
use veni_data::{Item, Part};
use veni_fit::shade::{
    Camera, Colour, DistantLights, Material, REFERENCE_FIELD_OF_VIEW, RenderedImage, RenderingLoss,
    ShadingForm, Surface, Transfer,
};
use veni_image::Panorama;
use veni_image::metrics::{Alignment, psnr};
use veni_light::latent::Latent;
use veni_light::sphere::Equirect;

/// Exponent of the highlight: the reference's.
const SHININESS: f32 = 500.0;
/// Weight of the prior over latents.
const PRIOR: f64 = 1e-4;

/// Sizes and effort.
#[derive(Clone, Copy, Debug, Serialize)]
struct Set {
    /// Side of the picture, pixels.
    side: usize,
    /// Width of the panorama of lights.
    lights: usize,
    steps: u64,
    sweep: &'static [f32],
}

const WHOLE: Set = Set { side: 64, lights: 64, steps: 400, sweep: &[0.0, 0.2, 0.5, 0.8, 1.0] };
const QUICK: Set = Set { side: 32, lights: 32, steps: 100, sweep: &[0.0, 0.5, 1.0] };

/// What is kept of a fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Found {
    vectors: Vec<[f32; 3]>,
    loss: f64,
}

/// Table 1: means per model and K_s; table 2: every panorama; a curve over K_s, and a sheet per model.
///
/// # Errors
/// As rendering, fitting, decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let mut report = Report::default();
    let set = if run.settings.quick { QUICK } else { WHOLE };
    let columns =
        |first: &[&'static str]| [first, &["*PSNR of log radiance"], &quality::COLUMNS[..]].concat();
    let mut means = Table::new(
        "inverse-rendering",
        "Light from the rendered image of a ball",
        &columns(&["System", "D", "K_s", "loss of the picture"]),
    );
    let mut each = Table::new(
        "inverse-rendering-images",
        "Light from the rendered image of a ball, each panorama",
        &columns(&["Panorama", "System", "K_s", "loss of the picture"]),
    );
    let mut curves = Vec::new();
    for subject in run.subjects {
        let mut line = Vec::new();
        let mut sheet = Balls::new(run, set);
        for (at, ks) in set.sweep.iter().enumerate() {
            let rows = swept(run, subject, set, *ks)?;
            for (row, (item, one)) in run.data.items().iter().zip(&rows).enumerate() {
                sheet.place(run, at, row, item, &one.image);
                let first = [Cell::text(item.name()), Cell::text(subject.name())];
                each.push(first.into_iter().chain(one.cells(*ks)).collect());
            }
            let mean = mean(&rows);
            line.push([f64::from(*ks), mean.quality.exposure.scores.ldr_psnr]);
            let first = [Cell::text(subject.name()), Cell::Number(subject.dimension() as f64, 0)];
            means.push(first.into_iter().chain(mean.cells(*ks)).collect());
        }
        curves.push(Series { name: subject.name().to_owned(), points: line, joined: true });
        run.sheet(&format!("inverse-rendering-{}", subject.name()), &sheet.sheet, &mut report)?;
    }
    let axes = [Axis::linear("K_s"), Axis::linear("LDR PSNR (exp.), dB")];
    let plot = Plot { title: "Light from the rendered image of a ball".to_owned(), axes, series: curves };
    run.plot("inverse-rendering", &plot, &mut report)?;
    means.note(format!(
        "A ball of {side} × {side} pixels, shininess {SHININESS}, under {lights} × {half} lights; {steps} Adam steps from \
         latent 0, exposure free, prior {PRIOR}.",
        side = set.side,
        lights = set.lights,
        half = set.lights / 2,
        steps = set.steps
    ));
    means.note(quality::NOTE);
    (report.tables, report.details) = (vec![means], vec![each]);
    Ok(report)
}

/// One panorama's light, as found.
struct One {
    image: Vec<f32>,
    quality: Quality,
    log_psnr: f64,
    loss: f64,
}

impl One {
    fn cells(&self, ks: f32) -> Vec<Cell> {
        let first =
            [Cell::Number(f64::from(ks), 1), Cell::Scientific(self.loss), Cell::Number(self.log_psnr, 2)];
        first.into_iter().chain(self.quality.cells()).collect()
    }
}

fn mean(rows: &[One]) -> One {
    let n = rows.len() as f64;
    let over = |f: &dyn Fn(&One) -> f64| rows.iter().map(f).sum::<f64>() / n;
    let each: Vec<_> = rows.iter().map(|one| one.quality).collect();
    One {
        image: Vec::new(),
        quality: Quality::mean(&each),
        log_psnr: over(&|one| one.log_psnr),
        loss: over(&|one| one.loss),
    }
}

/// The fits of a share of the panoramas.
///
/// # Errors
/// As rendering, fitting and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    let set = if run.settings.quick { QUICK } else { WHOLE };
    for subject in run.subjects {
        set.sweep.iter().try_for_each(|ks| fits(run, subject, set, *ks).keep(run, part))?;
    }
    Ok(())
}

fn fits<'a>(run: &Evaluation<'a>, subject: &'a LoadedModel, set: Set, ks: f32) -> Work<'a, Found> {
    let (grid, items) = (run.data.grid(), run.data.items());
    let keys: Vec<_> = (items.iter().zip(images(run)))
        .map(|(item, image)| Key {
            protocol: "inverse-rendering",
            name: format!("{}-{}-ks{ks}", item.name(), subject.name()),
            decides: Canonical::of(json!({
                "model": subject.identity(), "set": [set.side, set.lights], "steps": set.steps, "prior": PRIOR,
                "ks": ks, "shininess": SHININESS, "image": image,
            })),
        })
        .collect();
    let task = format!("{}, K_s = {ks}", subject.name());
    Work::new("panorama", task, keys, move |i| {
        fitted(subject, grid, &items[i], set, ks)
            .map_err(|e| Error::invalid(format!("{}: {e}", subject.name())))
    })
}

fn swept(run: &Evaluation<'_>, subject: &LoadedModel, set: Set, ks: f32) -> Result<Vec<One>> {
    let (grid, items) = (run.data.grid(), run.data.items());
    let found = fits(run, subject, set, ks).all(run)?;
    let one = |(item, found): (&Item, &Found)| -> Result<One> {
        let image = subject.decode(grid, &[Latent::new(found.vectors.clone())])?.concat();
        let quality = rate(grid, item, &image, run.lpips)?;
        let aligned = Alignment::Exposure.apply(&image, &item.log_radiance, grid.height);
        let target: Vec<f64> = item.log_radiance.iter().map(|v| f64::from(*v)).collect();
        Ok(One { image, quality, log_psnr: psnr(&aligned, &target), loss: found.loss })
    };
    items.iter().zip(&found).map(one).collect()
}

/// A white ball with K_s, seen from the horizon.
fn ball(set: Set, ks: f32) -> Result<Transfer> {
    let (place, size) = (([0.0; 3], 1.0), [set.side; 2]);
    let camera = Camera::framing(place, [0.0; 2], REFERENCE_FIELD_OF_VIEW, size, 0.05)?;
    let surface = Surface::sphere(&camera, place, set.side, set.side)?;
    let white = Colour::Uniform([1.0; 3]);
    let material =
        if ks > 0.0 { Material::blinn_phong(white, ks, SHININESS) } else { Material::lambert(white) };
    let lights = DistantLights::equirect(Equirect::new(set.lights, set.lights / 2));
    Transfer::new(&surface, &material, lights, ShadingForm::Physical)
}

/// The panorama's light on the grid of lights.
fn light(grid: Equirect, item: &Item, set: Set) -> Panorama {
    let pixels = item.log_radiance.as_chunks::<3>().0;
    Panorama::from_log(grid, pixels).resample(Equirect::new(set.lights, set.lights / 2))
}

fn fitted(subject: &LoadedModel, grid: Equirect, item: &Item, set: Set, ks: f32) -> Result<Found> {
    let transfer = ball(set, ks)?;
    let picture = transfer.render(light(grid, item, set).pixels());
    let image = RenderedImage::new(transfer, &picture, RenderingLoss::default())?;
    let mut start = Latent::new(vec![[0.0; 3]; subject.latent_vectors()]);
    let small = Equirect::new(set.lights, set.lights / 2);
    let dark = subject.decode(small, std::slice::from_ref(&start))?.concat();
    start.log_exposure = matching_exposure(&image, &picture, dark.as_chunks().0);
    let config = FitConfig { prior: PRIOR, free_exposure: true, ..FitConfig::light().in_steps(set.steps) };
    let (images, prior, starts) = ([image], subject.prior(), [start]);
    let FitResult { latents, last, .. } = fit_rendered(
        subject.fit_decoder().as_dyn(),
        &images,
        Some(&prior),
        &starts,
        &config,
        &mut |_, _| {},
    )?;
    let vectors = latents.into_iter().next().map(|z| z.vectors).unwrap_or_default();
    Ok(Found { vectors, loss: last.into_iter().sum() })
}

/// Panorama, and the light found for each K_s.
struct Balls {
    sheet: LabelledSheet,
}

impl Balls {
    fn new(run: &Evaluation<'_>, set: Set) -> Self {
        let titles =
            std::iter::once("panorama".to_owned()).chain(set.sweep.iter().map(|ks| format!("K_s = {ks}")));
        let names: Vec<_> = run.data.items().iter().map(Item::name).collect();
        Self { sheet: LabelledSheet::new(run.data.grid(), &titles.collect::<Vec<_>>(), &names) }
    }

    fn place(&mut self, run: &Evaluation<'_>, at: usize, row: usize, item: &Item, image: &[f32]) {
        let grid = run.data.grid();
        if at == 0 {
            self.sheet.place(0, row, &display(grid, &item.log_radiance));
        }
        self.sheet.place(1 + at, row, &display(grid, image));
    }
}
