//! `realism`: are random skies like photographed ones?
//!
//! Skies drawn from a model's prior, suns included, at exposure 0 beside the panoramas. *Statistics*: quartiles over skies of what
//! lights a scene and of what a viewer sees. *Patches*: the sliced Wasserstein distance of patches of log radiance at two scales,
//! beside the same between two halves of the panoramas, which is what the number of panoramas leaves to chance.

use super::patches::{PATCH, distance, patches};
use super::{Evaluation, Report};
use crate::table::{Cell, Table};
use crate::{Error, Result};
use veni_core::LoadedModel;
use veni_data::coarsen::{averaged, coarse_grid};
use veni_data::parallel::parallel;
use veni_image::exposure::centre_exposure;
use veni_light::latent::Latent;
use veni_light::light::{EnvironmentMap, Light, luminance};
use veni_light::random::{Purpose, stream};
use veni_light::skies::SkyMeasures;
use veni_light::sphere::Equirect;

/// Random skies; in quick evaluations.
const SKIES: [usize; 2] = [500, 60];
/// Skies that are decoded together.
const BATCH: usize = 20;
/// Places of the streams of random numbers.
const SLOT: u64 = 77;
/// Shadows are compared under suns that are higher, radians, 10°: of lower ones little falls on level ground.
const HIGH: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// What is measured of a sky.
struct Measured {
    sky: SkyMeasures,
    /// In the order of [`NAMES`].
    seen: [f64; NAMES.len()],
}

/// Statistics of what a viewer sees.
const NAMES: [&str; 5] = [
    "Deviation of ln Y",
    "Mean ln Y, upper half less lower",
    "Mean ln B/R, upper half",
    "Mean ln B/R, lower half",
    "Neighbours' difference in ln Y",
];

/// Table 1: statistics; table 2: distances of patches.
///
/// # Errors
/// [`Error::Invalid`] for fewer than four panoramas or a grid smaller than two patches; as decoding fails.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let (grid, items) = (run.data.grid(), run.data.items());
    if items.len() < 4 || grid.height < 2 * PATCH {
        return Err(Error::invalid(format!(
            "realism takes four panoramas of at least {} rows, not {} of {}",
            2 * PATCH,
            items.len(),
            grid.height
        )));
    }
    let photographs: Vec<&[f32]> = items.iter().map(|item| item.log_radiance.fetched()).collect();
    let mut statistics = Table::new("realism", "Statistics of skies", &columns());
    let mut distances = Table::new(
        "realism-patches",
        "Sliced Wasserstein distance of patches of log radiance",
        &["Skies", "D", "*At full size", "*At half size"],
    );
    statistics.push(row("photographs", &measured(grid, &photographs)?));
    for subject in run.subjects {
        let skies = random(run, subject)?;
        let skies: Vec<&[f32]> = skies.iter().map(Vec::as_slice).collect();
        statistics.push(row(subject.name(), &measured(grid, &skies)?));
        let dimension = Cell::Number(subject.dimension() as f64, 0);
        let of = |all: &[&[f32]]| compared(run.settings.seed, grid, all, &photographs);
        distances.push([vec![Cell::text(subject.name()), dimension], of(&skies)].concat());
    }
    let (even, odd): (Vec<_>, Vec<_>) = (0..items.len()).partition(|at| at % 2 == 0);
    let half = |chosen: &[usize]| chosen.iter().map(|at| photographs[*at]).collect::<Vec<_>>();
    let halves = compared(run.settings.seed, grid, &half(&even), &half(&odd));
    distances.push(
        [vec![Cell::text("half of the photographs, the other half"), Cell::missing("")], halves].concat(),
    );
    statistics.note(format!(
        "Quartiles over skies. Overcast: share of the light on level ground that is not the sun's, where the sun is higher than \
         {:.0}°; 1 less it is the contrast of a pole's shadow. Skies without sun count in the first column alone.",
        HIGH.to_degrees()
    ));
    distances.note(format!("Against the photographs; patches of {PATCH} × {PATCH} pixels; less is better."));
    Ok(Report { tables: vec![statistics, distances], ..Report::default() })
}

fn columns() -> Vec<&'static str> {
    ["Skies", "Share with a sun", "Sun's elevation, °", "Overcast under a sun"]
        .into_iter()
        .chain(NAMES)
        .collect()
}

/// Log radiance of random skies at exposure 0.
fn random(run: &Evaluation<'_>, subject: &LoadedModel) -> Result<Vec<Vec<f32>>> {
    let (grid, prior) = (run.data.grid(), subject.prior());
    let count = SKIES[usize::from(run.settings.quick)];
    run.observer.begin("sky", "random skies", 0, count);
    let blocks = parallel(count.div_ceil(BATCH), |block| {
        let draw = |at: usize| {
            let mut rng = stream(run.settings.seed, Purpose::Evaluation, at as u64, SLOT);
            Latent { log_exposure: 0.0, ..Latent::sample(&prior, &mut rng) }
        };
        let latents: Vec<_> = (block * BATCH..count.min((block + 1) * BATCH)).map(draw).collect();
        let mut images = subject.decode(grid, &latents)?;
        for image in &mut images {
            centre_exposure(grid, image);
        }
        run.observer.advance(images.len());
        Ok(images)
    })?;
    Ok(blocks.concat())
}

fn measured(grid: Equirect, all: &[&[f32]]) -> Result<Vec<Measured>> {
    parallel(all.len(), |at| {
        let pixels: Vec<[f32; 3]> = all[at].as_chunks().0.iter().map(|p| p.map(f32::exp)).collect();
        let sky = SkyMeasures::of(&Light::of(EnvironmentMap::new(grid, &pixels)?));
        Ok(Measured { sky, seen: seen(grid, &pixels) })
    })
}

/// The statistics of [`NAMES`].
fn seen(grid: Equirect, pixels: &[[f32; 3]]) -> [f64; NAMES.len()] {
    let log: Vec<f64> = pixels.iter().map(|p| f64::from(luminance(*p).max(f32::MIN_POSITIVE)).ln()).collect();
    let ratio = |k: usize| f64::from(pixels[k][2] / pixels[k][0].max(f32::MIN_POSITIVE)).max(1e-6).ln();
    let mean = |rows: std::ops::Range<usize>, of: &dyn Fn(usize) -> f64| {
        let (mut sum, mut whole) = (0.0, 0.0);
        for k in rows.start * grid.width..rows.end * grid.width {
            let weight = grid.solid_angle(k / grid.width);
            (sum, whole) = (sum + weight * of(k), whole + weight);
        }
        sum / whole
    };
    let (all, half) = (0..grid.height, grid.height / 2);
    let level = mean(all.clone(), &|k| log[k]);
    let next = |k: usize| k - k % grid.width + (k + 1) % grid.width;
    [
        mean(all.clone(), &|k| (log[k] - level).powi(2)).sqrt(),
        mean(0..half, &|k| log[k]) - mean(half..grid.height, &|k| log[k]),
        mean(0..half, &ratio),
        mean(half..grid.height, &ratio),
        mean(all, &|k| (log[k] - log[next(k)]).abs()),
    ]
}

fn row(name: &str, all: &[Measured]) -> Vec<Cell> {
    let suns: Vec<_> =
        all.iter().filter_map(|m| m.sky.sun.map(|[_, elevation]| (elevation, m.sky.overcast))).collect();
    let share = suns.len() as f64 / all.len() as f64;
    let elevations = quartiles(suns.iter().map(|(elevation, _)| elevation.to_degrees()), 0);
    let high = suns.iter().filter(|(elevation, _)| *elevation > HIGH);
    let overcast = quartiles(high.map(|(_, overcast)| *overcast), 2);
    let rest = (0..NAMES.len()).map(|k| quartiles(all.iter().map(|m| m.seen[k]), 2));
    [Cell::text(name), Cell::Number(share, 2), elevations, overcast].into_iter().chain(rest).collect()
}

/// Median and quartiles, as text.
fn quartiles(values: impl Iterator<Item = f64>, digits: usize) -> Cell {
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return Cell::missing("no sun") };
    let at = |share: f64| values[(share * last as f64).round() as usize];
    Cell::text(format!("{:.digits$} ({:.digits$} … {:.digits$})", at(0.5), at(0.25), at(0.75)))
}

/// Distances at full size and at half of it.
fn compared(seed: u64, grid: Equirect, all: &[&[f32]], others: &[&[f32]]) -> Vec<Cell> {
    let halved = |all: &[&[f32]]| all.iter().map(|image| averaged(grid, image, 2)).collect::<Vec<_>>();
    let of = |grid: Equirect, a: &[&[f32]], b: &[&[f32]]| {
        distance(seed, &patches(seed, grid, a), &patches(seed + 1, grid, b))
    };
    let (a, b) = (halved(all), halved(others));
    let [a, b] = [&a, &b].map(|all| all.iter().map(Vec::as_slice).collect::<Vec<_>>());
    let values = [of(grid, all, others), of(coarse_grid(grid, 2), &a, &b)];
    values.map(|value| Cell::Number(value, 3)).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Equirect = Equirect { width: 64, height: 32 };

    /// A blue sky of some height of contrast.
    fn sky(contrast: f32) -> Vec<f32> {
        let log = |d: [f32; 3]| [0.0, 0.1, 0.3].map(|c| if d[2] > 0.0 { contrast * d[0] + c } else { -1.0 });
        GRID.directions().into_iter().flat_map(log).collect()
    }

    #[test]
    fn statistics_are_those_of_the_sky() {
        let flat = sky(0.0);
        let [found] = &measured(GRID, &[&flat]).unwrap()[..] else { panic!("one") };
        assert!(found.sky.sun.is_none() && found.sky.overcast == 1.0);
        let upper = luminance([0.0f32, 0.1, 0.3].map(f32::exp)).ln();
        assert!((found.seen[1] - f64::from(upper + 1.0)).abs() < 1e-4, "{:?}", found.seen);
        assert!((found.seen[2] - 0.3).abs() < 1e-5 && found.seen[3].abs() < 1e-6, "{:?}", found.seen);
        assert!(found.seen[4].abs() < 1e-6);
    }

    #[test]
    fn other_skies_are_further_away_than_the_same() {
        let some: Vec<_> = (0..8).map(|k| sky(0.1 * k as f32)).collect();
        let other: Vec<_> = (0..8).map(|k| sky(2.0 + 0.1 * k as f32)).collect();
        let (a, b): (Vec<&[f32]>, Vec<&[f32]>) =
            (some.iter().map(Vec::as_slice).collect(), other.iter().map(Vec::as_slice).collect());
        let value = |cells: &[Cell], at: usize| match cells[at] {
            Cell::Number(value, _) => value,
            _ => panic!("a number"),
        };
        let (same, apart) = (compared(1, GRID, &a, &a), compared(1, GRID, &a, &b));
        for at in 0..2 {
            assert!(value(&apart, at) > 3.0 * value(&same, at), "{same:?} {apart:?}");
        }
    }
}
