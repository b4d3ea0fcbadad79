//! `photo`: from a photograph of part of the scene to the whole light. MODEL (77, 80).
//!
//! Of each panorama a camera takes four photographs of eight bits; the latent that is fitted to one, with the sun that
//! the prior thinks likely out of sight ([`UnseenSettings`]), is judged as `light` and `spheres` judge, in the camera's frame. Beside it
//! the mean sky of the training panoramas and the training panorama whose photograph is nearest. A photograph does not tell how
//! bright its white is: the measures do not depend on exposure, but for the one that takes the white as known.

use serde_json::json;

use super::camera::{self, Camera, Photograph};
use super::light::{self, Lit, compare, level, summary, sun_cells};
use super::spheres::{self, Balls, Errors};
use super::training::{Seen, mean_sky, training, turned};
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
use veni_image::Panorama;
use veni_light::sphere::Equirect;

/// Where the camera looks, degrees.
const AZIMUTHS: [u32; 4] = [0, 90, 180, 270];
/// Most columns of a panorama that lights the balls.
const BALLS_WIDTH: usize = 128;
/// What is compared beside the models.
const BASELINES: [&str; 2] = ["mean of training", "nearest of training"];

/// Titles of the columns of light.
const COLUMNS: [&str; 9] = [
    "E error",
    "median",
    "worst",
    "white known",
    light::COLUMNS[4],
    light::COLUMNS[5],
    light::COLUMNS[6],
    light::COLUMNS[7],
    light::COLUMNS[8],
];

/// How a light came out.
struct Judged {
    lit: Lit,
    balls: [Errors; 3],
    picture: Vec<[u8; 3]>,
}

/// What is made of one photograph.
struct Shot {
    photograph: Photograph,
    truth: Vec<[u8; 3]>,
    /// Where the panorama's sun is.
    sun: &'static str,
    /// The training panorama that was nearest.
    nearest: String,
    /// Models, then [`BASELINES`].
    judged: Vec<Judged>,
}

/// Table 1: each model and baseline over all photographs; table 2: each photograph; a sheet per azimuth.
///
/// # Errors
/// [`Error::Invalid`] without training panoramas; as fitting, decoding and writing fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let mut report = Report::default();
    let shots = shots(run)?;
    let titles = |first: &[&'static str], light: &[&'static str]| [first, light, &spheres::COLUMNS].concat();
    let mut all = Table::new("photo", "Light from a photograph", &titles(&["System", "D"], &COLUMNS));
    let columns = ["E error", "white known", "Sun, °", "Sun's E⊥, ln"];
    let first = ["Panorama", "Azimuth, °", "Its sun is", "System", "Nearest"];
    let mut each = Table::new("photo-images", "Light from each photograph", &titles(&first, &columns));
    for (at, (name, dimension)) in systems(run).into_iter().enumerate() {
        let judged: Vec<_> = shots.iter().map(|shot| &shot.judged[at]).collect();
        let (lit, balls): (Vec<_>, Vec<_>) = judged.iter().map(|j| (j.lit, j.balls)).unzip();
        let numbers = summary(&lit, [&|l| l.aligned, &|l| l.error]);
        let named = vec![Cell::text(&name), dimension];
        all.push([named, numbers, spheres::cells(&spheres::mean(&balls))].concat());
        for (k, (shot, judged)) in shots.iter().zip(judged).enumerate() {
            let (item, azimuth) = place(run, k);
            let named = vec![
                Cell::text(item.name()),
                Cell::Number(f64::from(azimuth), 0),
                Cell::text(shot.sun),
                Cell::text(&name),
                Cell::text(&shot.nearest),
            ];
            let errors = vec![Cell::Number(judged.lit.aligned, 3), Cell::Number(judged.lit.error, 3)];
            let suns = sun_cells(judged.lit.sun).to_vec();
            each.push([named, errors, suns, spheres::cells(&judged.balls)].concat());
        }
    }
    note(&mut all);
    for azimuth in AZIMUTHS {
        run.sheet(&format!("photo-{azimuth:03}"), &sheet(run, &shots, azimuth), &mut report)?;
    }
    (report.tables, report.details) = (vec![all], vec![each]);
    Ok(report)
}

fn note(table: &mut Table) {
    table.note(format!(
        "Photographs of {} × {} pixels, {}° across, azimuths {AZIMUTHS:?}°, elevation 0°; the {} % quantile of luminance is white, \
         8 bits. E error: root mean square of ln E/E_true over surfaces facing 26 ways at the best exposure, over all photographs; \
         median and worst of them; white known: the same at the exposure of the photograph's white. Sun: at the best exposure, over \
         the photographs of panoramas with one in both.",
        camera::SIZE[0],
        camera::SIZE[1],
        camera::FIELD,
        100.0 * camera::WHITE,
    ));
    table.note(
        "Balls: before the camera. No number but \"white known\" depends on the exposure; less is better. Mean of training: of \
         radiance, over panoramas and azimuths; nearest: by the display values of its photographs in twelve directions.",
    );
}

/// The fits of a share of the photographs.
///
/// # Errors
/// As fitting and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    let camera = Camera::new(run.data.grid());
    run.subjects.iter().try_for_each(|subject| fits(run, subject, &camera).keep(run, part))
}

/// The panorama and the azimuth of a photograph.
fn place<'a>(run: &Evaluation<'a>, at: usize) -> (&'a Item, u32) {
    (&run.data.items()[at / AZIMUTHS.len()], AZIMUTHS[at % AZIMUTHS.len()])
}

/// Names and dimensions of what is compared.
fn systems(run: &Evaluation<'_>) -> Vec<(String, Cell)> {
    let models = run.subjects.iter().map(|s| (s.name().to_owned(), Cell::Number(s.dimension() as f64, 0)));
    models.chain(BASELINES.map(|name| (name.to_owned(), Cell::missing("")))).collect()
}

/// Log radiance of a panorama in the camera's frame.
fn before(grid: Equirect, item: &Item, azimuth: u32) -> Vec<f32> {
    turned(grid, &item.log_radiance, f64::from(azimuth).to_radians())
}

fn radiance(log: &[f32]) -> Vec<[f32; 3]> {
    log.as_chunks().0.iter().map(|p| p.map(f32::exp)).collect()
}

fn fits<'a>(run: &Evaluation<'a>, subject: &'a LoadedModel, camera: &'a Camera) -> Work<'a, Vec<f32>> {
    let (grid, settings) = (run.data.grid(), UnseenSettings::new(run.settings.seed, run.settings.quick));
    let (images, data) = (images(run), run.data);
    let key = |at: usize| {
        let (item, azimuth) = place(run, at);
        Key {
            protocol: "photo",
            name: format!("{}-{azimuth:03}-{}", item.name(), subject.name()),
            decides: Canonical::of(json!({
                "model": subject.identity(), "fit": settings.key(), "azimuth": azimuth, "image": images[at / AZIMUTHS.len()],
                "camera": [json!(camera::SIZE), json!(camera::FIELD), json!(camera::WHITE)],
            })),
        }
    };
    let keys = (0..data.len() * AZIMUTHS.len()).map(key).collect();
    Work::new("photograph", subject.name().to_owned(), keys, move |at| {
        let (item, azimuth) = (&data.items()[at / AZIMUTHS.len()], AZIMUTHS[at % AZIMUTHS.len()]);
        let picture = camera.take(&radiance(&before(grid, item, azimuth))).picture()?;
        let found = settings.fit(subject, &picture, Some(&camera::view()));
        Ok(code(&found.map_err(|e| {
            Error::invalid(format!("{}, {}, azimuth {azimuth}°: {e}", subject.name(), item.name()))
        })?))
    })
}

fn shots(run: &Evaluation<'_>) -> Result<Vec<Shot>> {
    let (grid, train) = (run.data.grid(), training(run, "photo")?);
    let camera = Camera::new(grid);
    let codes = run.subjects.iter().map(|s| fits(run, s, &camera).all(run)).collect::<Result<Vec<_>>>()?;
    let (seen, sky) = (Seen::new(train, &camera)?, mean_sky(train));
    let sky_white = camera.take(&radiance(&sky)).white;
    let judge = Judge::new(grid);
    let count = run.data.len() * AZIMUTHS.len();
    run.observer.begin("photograph", "measures", 0, count);
    parallel(count, |at| {
        let (item, azimuth) = place(run, at);
        let truth = before(grid, item, azimuth);
        let photograph = camera.take(&radiance(&truth));
        let nearest = seen.nearest(&photograph);
        let balls = judge.balls(&truth);
        // radiance of white in the photograph is 1 for a fit, and another in the photographs of the baselines
        let mut judged = Vec::new();
        for (subject, codes) in run.subjects.iter().zip(&codes) {
            let decoded = subject.decode(grid, &[latent(subject, &codes[at])])?.concat();
            judged.push(judge.judge(&decoded, photograph.white, &truth, &balls)?);
        }
        judged.push(judge.judge(&sky, photograph.white / sky_white, &truth, &balls)?);
        judged.push(judge.judge(&nearest.log_radiance, photograph.white / nearest.white, &truth, &balls)?);
        run.observer.advance(1);
        Ok(Shot {
            sun: sun_place(grid, &truth)?,
            truth: thumbnail(grid, &truth),
            nearest: format!("{}, {:.0}°", nearest.name, nearest.azimuth.to_degrees()),
            photograph,
            judged,
        })
    })
}

fn sun_place(grid: Equirect, truth: &[f32]) -> Result<&'static str> {
    let [width, height] = camera::SIZE;
    Ok(match light::sun(grid, truth)? {
        None => "not there",
        Some(sun) if camera::view().pixel_of(sun.direction, width, height).is_some() => "in sight",
        Some(_) => "out of sight",
    })
}

/// The measures.
struct Judge {
    grid: Equirect,
    small: Equirect,
    balls: Balls,
}

impl Judge {
    fn new(grid: Equirect) -> Self {
        let small = if grid.width > BALLS_WIDTH { Equirect::new(BALLS_WIDTH, BALLS_WIDTH / 2) } else { grid };
        Self { grid, small, balls: Balls::new(small) }
    }

    fn balls(&self, log_radiance: &[f32]) -> [Vec<[f64; 3]>; 3] {
        let small = Panorama::from_log(self.grid, log_radiance.as_chunks().0).resample(self.small);
        self.balls.render(&small.pixels().as_flattened().iter().map(|v| v.ln()).collect::<Vec<_>>())
    }

    /// Light whose radiance times `white` is in the panorama's unit.
    fn judge(&self, found: &[f32], white: f32, truth: &[f32], balls: &[Vec<[f64; 3]>; 3]) -> Result<Judged> {
        let level = level(self.grid, found, truth);
        let aligned: Vec<f32> = found.iter().map(|v| v - level as f32).collect();
        let lit = compare(self.grid, &aligned, truth)?;
        let off = level + f64::from(white).ln();
        Ok(Judged {
            lit: Lit { error: lit.aligned.hypot(off), ..lit },
            balls: self.balls.errors(&self.balls(found), balls),
            picture: thumbnail(self.grid, found),
        })
    }
}

/// Photograph, panorama, and what was made of it, of every panorama at one azimuth.
fn sheet(run: &Evaluation<'_>, shots: &[Shot], azimuth: u32) -> LabelledSheet {
    let grid = shown(run.data.grid());
    let titles: Vec<_> = ["photograph".to_owned(), "panorama".to_owned()]
        .into_iter()
        .chain(systems(run).into_iter().map(|(name, _)| name))
        .collect();
    let names: Vec<_> = run.data.items().iter().map(Item::name).collect();
    let mut sheet = LabelledSheet::new(grid, &titles, &names);
    let chosen = shots.iter().enumerate().filter(|(at, _)| place(run, *at).1 == azimuth);
    for (row, (_, shot)) in chosen.enumerate() {
        sheet.place(0, row, &framed(grid, &shot.photograph.values));
        sheet.place(1, row, &shot.truth);
        for (at, judged) in shot.judged.iter().enumerate() {
            sheet.place(2 + at, row, &judged.picture);
        }
    }
    sheet
}

/// A photograph as high as a cell, in its middle.
fn framed(grid: Equirect, values: &[[u8; 3]]) -> Vec<[u8; 3]> {
    let [width, height] = camera::SIZE;
    let wide = (grid.height * width / height).min(grid.width);
    let left = (grid.width - wide) / 2;
    let pixel = |at: usize| {
        let (row, column) = (at / grid.width, at % grid.width);
        if !(left..left + wide).contains(&column) {
            return [255; 3];
        }
        values[row * height / grid.height * width + (column - left) * width / wide]
    };
    (0..grid.len()).map(pixel).collect()
}

#[cfg(test)]
mod tests;
