//! `completion`: what a fit to one half of a panorama makes of the other. MODEL (81).
//!
//! The left half, or the lower one, is hidden; a latent is fitted to the rest ([`UnseenSettings`]). What is seen stays as it is, what is
//! hidden is decoded; the hidden part is scored without any alignment, since what is seen fixes the exposure, and the light of the
//! whole as `light` does. Beside it the mean sky of the training panoramas at the exposure of what is seen.

use serde_json::json;

use super::light::{self, Lit, Sun, between, compare, summary, sun_cells};
use super::training::{mean_sky, training};
use super::work::{Work, images};
use super::{Evaluation, Report, shown, thumbnail};
use crate::canonical::Canonical;
use crate::codec::model::{code, latent};
use crate::figure::LabelledSheet;
use crate::fitting::UnseenSettings;
use crate::store::Key;
use crate::table::{Cell, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_data::parallel::parallel;
use veni_data::{Item, Part};
use veni_image::Picture;
use veni_image::exposure::{log_luminance, over_pixels};
use veni_image::metrics::{psnr, ssim};
use veni_image::tonemap::{REFERENCE_QUANTILE, quantile, srgb};
use veni_light::light::CompactLight;
use veni_light::sphere::Equirect;

/// The fewest rows of which half has a structural similarity.
const MIN_HEIGHT: usize = 12;
/// What is compared beside the models.
const BASELINE: &str = "mean of training";

/// Which half is hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Half {
    Left,
    Lower,
}

impl Half {
    const ALL: [Self; 2] = [Self::Left, Self::Lower];

    fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Lower => "lower",
        }
    }

    fn hides(self, grid: Equirect, pixel: usize) -> bool {
        match self {
            Self::Left => pixel % grid.width < grid.width / 2,
            Self::Lower => pixel / grid.width >= grid.height / 2,
        }
    }

    /// Height and width of what is hidden.
    fn shape(self, Equirect { width, height }: Equirect) -> [usize; 2] {
        match self {
            Self::Left => [height, width / 2],
            Self::Lower => [height - height / 2, width],
        }
    }
}

/// How close what is hidden comes, and the light of the whole.
#[derive(Clone, Copy, Debug)]
struct Scored {
    /// Peak signal-to-noise ratio of display values, dB.
    ldr_psnr: f64,
    /// Structural similarity of display values.
    ssim: f64,
    /// Peak signal-to-noise ratio of log radiance, dB; the peak is the range of what is hidden.
    log_psnr: f64,
    lit: Lit,
}

/// Table 1: each model and the baseline for each half; table 2: each panorama; a sheet per half.
///
/// # Errors
/// [`Error::Invalid`] without training panoramas or for panoramas of few rows; as fitting, decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let (grid, items) = (run.data.grid(), run.data.items());
    check(grid)?;
    let sky = mean_sky(training(run, "completion")?);
    let mut report = Report::default();
    let scores = ["LDR PSNR", "SSIM", "Log PSNR"];
    let mut all = Table::new(
        "completion",
        "The hidden half of a panorama",
        &[&["System", "Hidden", "D"][..], &scores, &light::COLUMNS].concat(),
    );
    let columns = ["E error", "aligned", "Sun, °", "Sun's E⊥, ln"];
    let mut each = Table::new(
        "completion-images",
        "The hidden half of each panorama",
        &[&["Panorama", "Hidden", "System"][..], &scores, &columns].concat(),
    );
    for half in Half::ALL {
        let mut columns: Vec<(String, Vec<Vec<f32>>)> = Vec::new();
        for subject in run.subjects {
            let codes = fits(run, subject, half).all(run)?;
            let wholes = parallel(items.len(), |at| {
                let decoded = subject.decode(grid, &[latent(subject, &codes[at])])?.concat();
                Ok(completed(grid, half, &items[at].log_radiance, &decoded))
            })?;
            columns.push((subject.name().to_owned(), wholes));
        }
        let of_sky =
            |item: &Item| completed(grid, half, &item.log_radiance, &exposed(grid, half, item, &sky));
        columns.push((BASELINE.to_owned(), items.iter().map(of_sky).collect()));
        for (at, (name, wholes)) in columns.iter().enumerate() {
            let scored = parallel(items.len(), |k| score(grid, half, &wholes[k], &items[k].log_radiance))?;
            let dimension = run.subjects.get(at);
            let dimension =
                dimension.map_or_else(|| Cell::missing(""), |s| Cell::Number(s.dimension() as f64, 0));
            all.push([vec![Cell::text(name), Cell::text(half.name()), dimension], means(&scored)].concat());
            for (item, scored) in items.iter().zip(&scored) {
                let named = [item.name(), half.name().to_owned(), name.clone()].map(Cell::text).to_vec();
                each.push([named, cells(scored)].concat());
            }
        }
        run.sheet(&format!("completion-{}", half.name()), &sheet(run, half, &columns), &mut report)?;
    }
    all.note(
        "PSNR in dB and SSIM of the hidden half as it is, white being the 98 % quantile of the panorama, Log PSNR that of log radiance; means \
         over panoramas. E error: root mean square of ln E/E_true over surfaces facing 26 ways, of the seen half and the hidden one together, over all \
         panoramas; median and worst of them; aligned: at the best exposure. Suns: of the hidden half alone.",
    );
    all.note("Mean of training: of radiance, over panoramas and azimuths, with the mean log luminance of the seen half there.");
    (report.tables, report.details) = (vec![all], vec![each]);
    Ok(report)
}

/// The fits of a share of the panoramas.
///
/// # Errors
/// As fitting and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    check(run.data.grid())?;
    for subject in run.subjects {
        Half::ALL.iter().try_for_each(|half| fits(run, subject, *half).keep(run, part))?;
    }
    Ok(())
}

fn check(grid: Equirect) -> Result<()> {
    if grid.height < MIN_HEIGHT {
        return Err(Error::invalid(format!(
            "completion scores halves of panoramas, which need {MIN_HEIGHT} rows, not {}: compare panoramas of {} columns at least",
            grid.height,
            2 * MIN_HEIGHT
        )));
    }
    Ok(())
}

fn fits<'a>(run: &Evaluation<'a>, subject: &'a LoadedModel, half: Half) -> Work<'a, Vec<f32>> {
    let (grid, items) = (run.data.grid(), run.data.items());
    let settings = UnseenSettings::new(run.settings.seed, run.settings.quick);
    let key = |(item, image): (&Item, serde_json::Value)| Key {
        protocol: "completion",
        name: format!("{}-{}-{}", item.name(), half.name(), subject.name()),
        decides: Canonical::of(json!({
            "model": subject.identity(), "fit": settings.key(), "lights": subject.lights(),
            "hidden": half.name(), "image": image,
        })),
    };
    let keys = items.iter().zip(images(run)).map(key).collect();
    let task = format!("{}, {} half hidden", subject.name(), half.name());
    Work::new("panorama", task, keys, move |at| {
        let found = seen(grid, half, &items[at]).and_then(|picture| settings.fit(subject, &picture, None));
        Ok(code(&found.map_err(|e| {
            Error::invalid(format!(
                "{}, {}, {} half hidden: {e}",
                subject.name(),
                items[at].name(),
                half.name()
            ))
        })?))
    })
}

/// What is seen of a panorama.
fn seen(grid: Equirect, half: Half, item: &Item) -> Result<Picture> {
    let pixels = item.log_radiance.as_chunks::<3>().0;
    let seen = |p: usize| !half.hides(grid, p);
    let radiance = (0..grid.len()).map(|p| if seen(p) { pixels[p].map(f32::exp) } else { [0.0; 3] });
    let mask: Vec<f32> = (0..grid.len()).map(|p| f32::from(u8::from(seen(p)))).collect();
    Picture::new([grid.width, grid.height], radiance.collect())?.masked(&mask)
}

/// What is seen of `truth`, and the rest of `decoded`.
fn completed(grid: Equirect, half: Half, truth: &[f32], decoded: &[f32]) -> Vec<f32> {
    (0..3 * grid.len()).map(|k| if half.hides(grid, k / 3) { decoded[k] } else { truth[k] }).collect()
}

/// `sky` with the panorama's mean ln luminance over what is seen.
fn exposed(grid: Equirect, half: Half, item: &Item, sky: &[f32]) -> Vec<f32> {
    let weight = |p: usize| if half.hides(grid, p) { 0.0 } else { grid.solid_angle(p / grid.width) };
    let weights: Vec<f64> = (0..grid.len()).map(weight).collect();
    let mean = |image: &[f32]| {
        let logs: Vec<f64> = image.as_chunks().0.iter().map(|p| f64::from(log_luminance(*p))).collect();
        over_pixels(&logs, &weights)
    };
    let offset = mean(&item.log_radiance) - mean(sky);
    sky.iter().map(|v| v + offset).collect()
}

fn score(grid: Equirect, half: Half, whole: &[f32], truth: &[f32]) -> Result<Scored> {
    let hidden = |image: &[f32]| -> Vec<f32> {
        let kept = image.as_chunks::<3>().0.iter().enumerate().filter(|(p, _)| half.hides(grid, *p));
        kept.flat_map(|(_, pixel)| *pixel).collect()
    };
    let all: Vec<f32> = truth.iter().map(|v| v.exp()).collect();
    let white = quantile(&all, REFERENCE_QUANTILE).max(f32::MIN_POSITIVE);
    let exact = |values: &[f32]| values.iter().map(|v| f64::from(*v)).collect::<Vec<_>>();
    let display = |values: &[f32]| {
        values.iter().map(|v| f64::from(srgb(v.exp() / white).clamp(0.0, 1.0))).collect::<Vec<_>>()
    };
    let [found, expected] = [hidden(whole), hidden(truth)];
    let [height, width] = half.shape(grid);
    let (shown, target) = (display(&found), display(&expected));
    let lit = compare(grid, whole, truth)?;
    Ok(Scored {
        ldr_psnr: psnr(&shown, &target),
        ssim: ssim(&shown, &target, [height, width, 3]),
        log_psnr: psnr(&exact(&found), &exact(&expected)),
        lit: Lit { sun: hidden_sun(grid, half, whole, truth)?, ..lit },
    })
}

/// What became of a sun in the hidden half. One that is seen is where it was, and one beside it would be false.
fn hidden_sun(grid: Equirect, half: Half, whole: &[f32], truth: &[f32]) -> Result<Sun> {
    let hidden = |sun: &CompactLight| {
        let [column, row] = grid.pixel(sun.direction).map(|v| v as usize);
        half.hides(grid, row.min(grid.height - 1) * grid.width + column)
    };
    let of = |image: &[f32]| -> Result<Option<CompactLight>> { Ok(light::sun(grid, image)?.filter(hidden)) };
    Ok(between(of(truth)?, of(whole)?))
}

fn cells(scored: &Scored) -> Vec<Cell> {
    let Scored { ldr_psnr, ssim, log_psnr, lit } = *scored;
    let errors = [Cell::Number(lit.error, 3), Cell::Number(lit.aligned, 3)];
    score_cells([ldr_psnr, ssim, log_psnr]).into_iter().chain(errors).chain(sun_cells(lit.sun)).collect()
}

fn score_cells([ldr_psnr, ssim, log_psnr]: [f64; 3]) -> [Cell; 3] {
    [Cell::Number(ldr_psnr, 2), Cell::Number(ssim, 3), Cell::Number(log_psnr, 2)]
}

fn means(each: &[Scored]) -> Vec<Cell> {
    let mean = |score: fn(&Scored) -> f64| each.iter().map(score).sum::<f64>() / each.len() as f64;
    let scores = [mean(|s| s.ldr_psnr), mean(|s| s.ssim), mean(|s| s.log_psnr)];
    let lit: Vec<_> = each.iter().map(|s| s.lit).collect();
    score_cells(scores).into_iter().chain(summary(&lit, [&|l| l.error, &|l| l.aligned])).collect()
}

/// Panorama, what is seen of it, and the completions.
fn sheet(run: &Evaluation<'_>, half: Half, columns: &[(String, Vec<Vec<f32>>)]) -> LabelledSheet {
    let (grid, items) = (run.data.grid(), run.data.items());
    let small = shown(grid);
    let names: Vec<_> = items.iter().map(Item::name).collect();
    let titles: Vec<_> = ["panorama".to_owned(), "seen".to_owned()]
        .into_iter()
        .chain(columns.iter().map(|(name, _)| name.clone()))
        .collect();
    let mut sheet = LabelledSheet::new(small, &titles, &names);
    for (row, item) in items.iter().enumerate() {
        let mut picture = thumbnail(grid, &item.log_radiance);
        sheet.place(0, row, &picture);
        picture
            .iter_mut()
            .enumerate()
            .filter(|(p, _)| half.hides(small, *p))
            .for_each(|(_, v)| *v = [128; 3]);
        sheet.place(1, row, &picture);
        for (at, (_, wholes)) in columns.iter().enumerate() {
            sheet.place(2 + at, row, &thumbnail(grid, &wholes[row]));
        }
    }
    sheet
}

#[cfg(test)]
mod tests;
