//! `light`: does a decoded latent light things as the panorama does?
//!
//! *Irradiance*: E on surfaces facing 26 ways ([`ways`]), luminance, of the decoded panorama against the panorama's own. The
//! error of a panorama is √⟨(ln E/E_true)²⟩ over the ways; aligned, ⟨ln E/E_true⟩ is taken out first, as one exposure would.
//! *Sun*: that of the code, where it names one, as [`Light::of_field`](veni_light::light::Light::of_field) gives it to
//! renderers; otherwise [`Light`](veni_light::light::Light) looks for one in the decoded pixels, as it does in the panorama's own at the
//! resolution of the evaluation. The angle between the two, |ln| of the ratio of their irradiances, and how many panoramas have one in one of
//! the two only.

use super::quality::{Reconstructed, reconstruct};
use super::{Evaluation, Report, reconstruction};
use crate::Result;
use crate::codec::Codec;
use crate::table::{Cell, Table};
use veni_data::parallel::parallel;
use veni_data::{Item, Part};
use veni_light::light::{CompactLight, EnvironmentMap, LightOptions, luminance};
use veni_light::sphere::{Equirect, ways};
use veni_light::vector::dot;

/// Titles of the columns behind those that name a system.
pub(super) const COLUMNS: [&str; 9] = [
    "E error",
    "median",
    "worst",
    "aligned",
    "Sun, °, median",
    "Sun, °, worst",
    "Sun's E⊥, ln",
    "False suns",
    "Missed suns",
];

/// How one panorama's light came out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lit {
    /// √⟨(ln E/E_true)²⟩.
    pub(super) error: f64,
    /// The same at the best exposure.
    pub(super) aligned: f64,
    pub(super) sun: Sun,
}

/// What became of a panorama's sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sun {
    /// None is in either.
    None,
    /// One is decoded that the panorama has not.
    False,
    /// The panorama has one that is not decoded.
    Missed,
    /// Both have one: the angle between them in degrees, and |ln| of the ratio of their irradiances.
    Both { degrees: f64, irradiance: f64 },
}

/// Table 1: each codec over all panoramas; table 2: each panorama.
///
/// # Errors
/// As coding and decoding fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let first = |names: &[&'static str]| [names, &COLUMNS].concat();
    let mut all = Table::new("light", "Light of decoded panoramas", &first(&["System", "Pass", "D"]));
    let columns = ["Panorama", "System", "E error", "aligned", "Sun, °", "Sun's E⊥, ln"];
    let mut each = Table::new("light-images", "Light of each decoded panorama", &columns);
    for subject in run.subjects {
        let codecs = run.codecs(subject);
        codecs.iter().try_for_each(|codec| add(run, &**codec, &mut all, &mut each))?;
    }
    run.others.iter().try_for_each(|codec| add(run, *codec, &mut all, &mut each))?;
    all.note(
        "E error: root mean square of ln E/E_true over surfaces facing 26 ways, over all panoramas; median and worst of the \
         panoramas; aligned: at the best exposure of each. Sun: over the panoramas with one in both; that of the code where it \
         names one, otherwise looked for in the decoded pixels.",
    );
    all.note(run.optimised_note());
    Ok(Report { tables: vec![all], details: vec![each], ..Report::default() })
}

/// The codes of a share of the panoramas.
///
/// # Errors
/// As coding and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    reconstruction::keep(run, part)
}

fn add(run: &Evaluation<'_>, codec: &dyn Codec, all: &mut Table, each: &mut Table) -> Result<()> {
    let (grid, items) = (run.data.grid(), run.data.items());
    let Reconstructed { codes, images, .. } = reconstruct(run, codec)?;
    let lit = parallel(items.len(), |at| {
        let named = codec.lights(&codes[at]).and_then(|lights| lights.sun().copied());
        let found = named.map_or_else(|| sun(grid, &images[at]), |sun| Ok(Some(sun)))?;
        compare_with(grid, &images[at], &items[at].log_radiance, found)
    })?;
    let label = format!("{}, {}", codec.system(), codec.pass());
    for (item, lit) in items.iter().zip(&lit) {
        each.push(row(item, &label, lit));
    }
    let first =
        [Cell::text(codec.system()), Cell::text(codec.pass()), Cell::Number(codec.dimension() as f64, 0)];
    all.push(first.into_iter().chain(summary(&lit, [&|l| l.error, &|l| l.aligned])).collect());
    Ok(())
}

fn row(item: &Item, label: &str, lit: &Lit) -> Vec<Cell> {
    let errors = [Cell::Number(lit.error, 3), Cell::Number(lit.aligned, 3)];
    let named = [Cell::text(item.name()), Cell::text(label)];
    named.into_iter().chain(errors).chain(sun_cells(lit.sun)).collect()
}

/// Angle and ratio, or why there is none.
pub(super) fn sun_cells(sun: Sun) -> [Cell; 2] {
    match sun {
        Sun::None => ["none"; 2].map(missing),
        Sun::False => ["false sun"; 2].map(missing),
        Sun::Missed => ["missed"; 2].map(missing),
        Sun::Both { degrees, irradiance } => [Cell::Number(degrees, 2), Cell::Number(irradiance, 3)],
    }
}

fn missing(why: &str) -> Cell {
    Cell::Missing(why.to_owned())
}

/// One cell per column of [`COLUMNS`]: of `first` the root mean square, median and largest, of `second` the first of these, and of the
/// suns.
pub(super) fn summary(lit: &[Lit], [first, second]: [&dyn Fn(&Lit) -> f64; 2]) -> Vec<Cell> {
    let count = lit.len() as f64;
    let rms = |of: &dyn Fn(&Lit) -> f64| (lit.iter().map(|l| of(l).powi(2)).sum::<f64>() / count).sqrt();
    let sorted = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values
    };
    let errors = sorted(lit.iter().map(first).collect());
    let both: Vec<_> = lit
        .iter()
        .filter_map(|l| match l.sun {
            Sun::Both { degrees, irradiance } => Some((degrees, irradiance)),
            _ => None,
        })
        .collect();
    let degrees = sorted(both.iter().map(|b| b.0).collect());
    let ratios = sorted(both.iter().map(|b| b.1).collect());
    let number =
        |value: Option<f64>, digits| value.map_or_else(|| missing("no sun"), |v| Cell::Number(v, digits));
    let times = |sun: Sun| Cell::Number(lit.iter().filter(|l| l.sun == sun).count() as f64, 0);
    vec![
        Cell::Number(rms(first), 3),
        number(median(&errors), 3),
        number(errors.last().copied(), 3),
        Cell::Number(rms(second), 3),
        number(median(&degrees), 2),
        number(degrees.last().copied(), 2),
        number(median(&ratios), 3),
        times(Sun::False),
        times(Sun::Missed),
    ]
}

/// The middle of sorted values.
fn median(sorted: &[f64]) -> Option<f64> {
    let half = sorted.len() / 2;
    if sorted.len() % 2 == 1 {
        return sorted.get(half).copied();
    }
    Some(0.5 * (sorted.get(half.checked_sub(1)?)? + sorted.get(half)?))
}

/// Log radiance decoded against that of the panorama; suns are looked for in both.
pub(super) fn compare(grid: Equirect, decoded: &[f32], truth: &[f32]) -> Result<Lit> {
    compare_with(grid, decoded, truth, sun(grid, decoded)?)
}

/// [`compare`] where the decoded sun is known.
fn compare_with(grid: Equirect, decoded: &[f32], truth: &[f32], found: Option<CompactLight>) -> Result<Lit> {
    let logs = ratios(grid, decoded, truth);
    let level = mean(logs.iter().copied());
    Ok(Lit {
        error: mean(logs.iter().map(|l| l * l)).sqrt(),
        aligned: mean(logs.iter().map(|l| (l - level).powi(2))).sqrt(),
        sun: between(sun(grid, truth)?, found),
    })
}

/// ⟨ln E/E_true⟩ over the [`ways`]: the exposure by which decoded light is too bright.
pub(super) fn level(grid: Equirect, decoded: &[f32], truth: &[f32]) -> f64 {
    mean(ratios(grid, decoded, truth).into_iter())
}

/// ln E/E_true of each way.
fn ratios(grid: Equirect, decoded: &[f32], truth: &[f32]) -> Vec<f64> {
    let (found, expected) = (irradiance(grid, &radiance(decoded)), irradiance(grid, &radiance(truth)));
    found.iter().zip(&expected).map(|(a, b)| (a / b).ln()).collect()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

fn radiance(log: &[f32]) -> Vec<[f32; 3]> {
    log.as_chunks().0.iter().map(|p| p.map(f32::exp)).collect()
}

/// What became of the sun of a panorama in another.
pub(super) fn between(truth: Option<CompactLight>, found: Option<CompactLight>) -> Sun {
    match (truth, found) {
        (None, None) => Sun::None,
        (None, Some(_)) => Sun::False,
        (Some(_), None) => Sun::Missed,
        (Some(a), Some(b)) => {
            let chord: f32 = a.direction.iter().zip(b.direction).map(|(a, b)| (a - b) * (a - b)).sum();
            let degrees = 2.0 * f64::from(0.5 * chord.sqrt()).min(1.0).asin().to_degrees();
            let ratio = f64::from(luminance(b.irradiance)) / f64::from(luminance(a.irradiance));
            Sun::Both { degrees, irradiance: ratio.ln().abs() }
        }
    }
}

/// The sun of log radiance.
pub(super) fn sun(grid: Equirect, log_radiance: &[f32]) -> Result<Option<CompactLight>> {
    let options = LightOptions { lights: 1, ..LightOptions::default() };
    Ok(options.of(EnvironmentMap::new(grid, &radiance(log_radiance))?)?.sun().copied())
}

/// Irradiance (luminance) of surfaces that face the [`ways`].
fn irradiance(grid: Equirect, radiance: &[[f32; 3]]) -> Vec<f64> {
    let directions = grid.directions();
    let facing = |way: [f32; 3]| {
        let mut sum = 0.0;
        for (index, (direction, pixel)) in directions.iter().zip(radiance).enumerate() {
            let cosine = dot(*direction, way);
            if cosine > 0.0 {
                let weight = grid.solid_angle(index / grid.width) * f64::from(cosine);
                sum += weight * f64::from(luminance(*pixel));
            }
        }
        sum
    };
    ways().into_iter().map(facing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixels of 0.7°: of a sun within one, the place is known to that.
    const GRID: Equirect = Equirect { width: 512, height: 256 };

    /// Log radiance of a blue sky over grey ground, with a sun of this irradiance at an azimuth in degrees.
    fn sky(azimuth: f32, irradiance: f32) -> Vec<f32> {
        let below = |d: &[f32; 3]| if d[2] < 0.0 { [0.2; 3] } else { [0.5, 0.7, 1.0] };
        let mut pixels: Vec<_> = GRID.directions().iter().map(below).collect();
        let (sin, cos) = azimuth.to_radians().sin_cos();
        let sun = CompactLight::new([0.8 * cos, 0.8 * sin, 0.6], [irradiance; 3], CompactLight::SUN_RADIUS);
        sun.add_to(GRID, &mut pixels);
        pixels.into_flattened().into_iter().map(f32::ln).collect()
    }

    #[test]
    fn the_same_light_has_no_error_and_a_brighter_one_none_when_aligned() {
        let truth = sky(20.0, 8.0);
        let same = compare(GRID, &truth, &truth).unwrap();
        assert!(same.error < 1e-9 && same.aligned < 1e-9);
        assert!(matches!(same.sun, Sun::Both { degrees, irradiance } if degrees < 1e-3 && irradiance < 1e-6));
        let bright: Vec<f32> = truth.iter().map(|v| v + 0.5).collect();
        let bright = compare(GRID, &bright, &truth).unwrap();
        assert!((bright.error - 0.5).abs() < 1e-5 && bright.aligned < 1e-5, "{bright:?}");
    }

    #[test]
    fn suns_are_missed_made_up_and_out_of_place() {
        let (sunny, dull) = (sky(20.0, 8.0), sky(20.0, 0.0));
        let missed = compare(GRID, &dull, &sunny).unwrap();
        assert_eq!(missed.sun, Sun::Missed);
        assert!(missed.error > 0.5, "{missed:?}");
        assert_eq!(compare(GRID, &sunny, &dull).unwrap().sun, Sun::False);
        assert_eq!(compare(GRID, &dull, &dull).unwrap().sun, Sun::None);
        // in azimuth, at an elevation whose cosine is 0.8
        let moved = compare(GRID, &sky(30.0, 16.0), &sunny).unwrap();
        let Sun::Both { degrees, irradiance } = moved.sun else { panic!("{moved:?}") };
        let expected = 2.0 * (0.8 * 5f64.to_radians().sin()).asin().to_degrees();
        assert!((degrees - expected).abs() < 0.3 && (irradiance - 2f64.ln()).abs() < 0.05, "{moved:?}");
    }

    #[test]
    fn the_middle_of_even_and_odd() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0]), Some(3.0));
        assert_eq!(median(&[1.0, 2.0]), Some(1.5));
        assert_eq!(median(&[1.0, 2.0, 7.0]), Some(2.0));
        assert_eq!(ways().len(), 26);
    }
}
