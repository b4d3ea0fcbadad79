//! The lights of a map, one after the other: found, measured, taken out. LIGHT (1) to (8).

mod level;
mod measure;
mod opposite;
mod search;
mod shape;
mod sun;

use std::ops::Range;

use crate::compact::{CompactLight, Kind, Lights};
use crate::luminance::luminance;
use crate::sphere::Equirect;
use crate::tasks;
use crate::vector::{angle, dot, normalised};
pub(super) use level::Level;
use level::{Cell, View};
use measure::{Measured, core_centre, luminance_of, measure};
use opposite::Opposite;

/// Radii of the caps that a light is measured in, degrees.
const SCALES: [f64; 6] = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0];
/// The smallest cap in pixels: a disc within one pixel may be spread over two by whoever resampled the map.
const PIXELS: f64 = 3.0;
/// From one scale to the next, the excess of a light that the smaller one holds grows by less.
const GROWTH: f64 = 0.05;
/// A disc with more than this part of the cap's radius fills it.
const FULL: f64 = 0.7;
/// A cap has at least this many cells in its radius.
const CELLS: f64 = 5.0;
/// Columns of the coarser resolutions.
const WIDTHS: [usize; 2] = [1024, 256];

/// So far from where it is said to be, the sun is looked for, degrees.
const NEAR: f64 = 5.0;
/// The middle of a light of this extent or less is found on the pixels themselves, degrees.
const FINE: f64 = 5.0;

/// Which light is the sun.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SunChoice {
    /// The strongest above the horizon that looks like one; perhaps none.
    #[default]
    Auto,
    /// The strongest above the horizon, whatever it looks like.
    Sky,
    /// The strongest, wherever it is.
    Any,
    /// What is brightest near this direction, however faint.
    Towards([f32; 3]),
    /// None, and no other light is taken out.
    Nothing,
}

/// What is taken for a light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Criteria {
    /// The number that is looked for.
    pub(super) most: usize,
    /// The number that is kept, the sun first; the others are put back.
    pub(super) keep: usize,
    /// Those of a larger angular radius are put back too, radians.
    pub(super) widest: f32,
    pub(super) share: f64,
    pub(super) contrast: f64,
}

/// A map from which lights are taken.
pub(super) struct Extraction {
    pixels: Vec<[f32; 3]>,
    /// Finest first.
    levels: Vec<Level>,
    /// What was taken, light by light, where some will be put back.
    changes: Vec<Change>,
}

/// What taking a light changed.
struct Change {
    rows: Range<usize>,
    /// Pixel, its radiance before and after.
    pixels: Vec<(usize, [f32; 3], [f32; 3])>,
}

/// A light that was taken out.
#[derive(Clone, Copy, Debug)]
struct Found {
    light: CompactLight,
    /// How wide what was taken is.
    kind: Kind,
    /// Its share of the light that reached a surface facing it, 0 to 1 (luminance).
    share: f32,
    /// Its energy and its share with all that stands out about it, its own or not (luminance).
    whole: [f64; 2],
    /// The middle of its brightest part.
    core: [f32; 3],
    /// Its peak luminance.
    peak: f64,
    /// The how manyth it was to be found.
    order: usize,
    /// Where it was found.
    measured: Measured,
}

/// What an extraction gives.
pub(super) struct Extracted {
    pub(super) lights: Lights,
    /// A light's share of the light that reached a surface facing it, 0 to 1 (luminance), for each.
    pub(super) shares: Vec<f32>,
    /// What is left.
    pub(super) pixels: Vec<[f32; 3]>,
    /// The same at about 256 columns.
    pub(super) coarse: Level,
}

impl Extraction {
    pub(super) fn new(grid: Equirect, pixels: Vec<[f32; 3]>) -> Self {
        let mut factors = vec![1];
        factors.extend(WIDTHS.iter().map(|w| grid.width.div_ceil(*w)).filter(|k| *k > 1));
        factors.dedup();
        let levels = factors.into_iter().map(|k| Level::new(grid, &pixels, k)).collect();
        Self { pixels, levels, changes: Vec::new() }
    }

    /// Takes out lights until none is left that the criteria allow, and decides which is the sun. Which it is does not depend on
    /// how many are kept.
    pub(super) fn run(mut self, criteria: Criteria, choice: SunChoice) -> Extracted {
        let mut found = Vec::new();
        let mut sun = None;
        if let SunChoice::Towards(direction) = choice
            && criteria.keep > 0
            && let Some(measured) = self.near(direction)
        {
            found.push(self.take(&measured, false));
            sun = Some(0);
        }
        let nothing = choice == SunChoice::Nothing || criteria.keep == 0;
        let most = if nothing { 0 } else { criteria.most };
        while found.len() < most {
            // a bright pixel among sixteen still stands out, and the seed is only near it
            let seeds = search::seeds(self.view(1.min(self.levels.len() - 1)), self.coarsest());
            match self.strongest(&seeds, criteria) {
                Some(measured) => found.push(self.take(&measured, false)),
                None => break,
            }
        }
        // the one that was named stays in front
        let named = usize::from(sun.is_some());
        let energy = |f: &Found| luminance(f.light.irradiance);
        found[named..].sort_by(|a, b| energy(b).total_cmp(&energy(a)));
        sun = sun.or_else(|| sun::choose(&found, choice, self.coarsest()));
        if let Some(at) = sun {
            found[..=at].rotate_right(1);
            // shadows of the sun fall by its brightest part, whatever glows around it
            if found[0].kind == Kind::Glow {
                self.put_back(found[0].order);
                let Found { light, core, order, .. } = self.take(&found[0].measured, true);
                // the share is of the light that there was when it was found
                let [energy, share] = found[0].whole;
                let share = (share * f64::from(luminance(light.irradiance)) / energy) as f32;
                found[0] =
                    Found { light: CompactLight { direction: core, ..light }, share, order, ..found[0] };
            }
        }
        let narrow = |f: &Found| f.light.radius <= criteria.widest;
        sun = sun.filter(|_| found.first().is_some_and(narrow));
        let (mut kept, mut others): (Vec<_>, Vec<_>) = found.into_iter().partition(narrow);
        others.extend(kept.drain(criteria.keep.min(kept.len())..));
        others.sort_by_key(|f| std::cmp::Reverse(f.order));
        for f in others {
            self.put_back(f.order);
        }
        let found = kept;
        let shares = found.iter().map(|f| f.share).collect();
        let mut lights = found.into_iter().map(|f| f.light);
        let lights = Lights::new(sun.and_then(|_| lights.next()), lights);
        let coarse = self.levels.swap_remove(self.levels.len() - 1).keep(&self.pixels);
        Extracted { lights, shares, pixels: self.pixels, coarse }
    }

    /// The light at the brightest pixel near a direction, however faint.
    fn near(&self, direction: [f32; 3]) -> Option<Measured> {
        let direction = normalised(direction.map(f64::from))?;
        let radius = NEAR.to_radians().max(PIXELS * self.levels[0].cell_angle());
        let mut best: Option<(f32, [f64; 3])> = None;
        self.view(0).cap(direction, radius, |cell| {
            let y = luminance(cell.radiance);
            if best.is_none_or(|(most, _)| y > most) {
                best = Some((y, cell.direction));
            }
        });
        self.settled(best?.1, 0.0).filter(|m| angle(m.centre, direction) <= radius + m.scale)
    }

    /// The candidate of the greatest excess.
    fn strongest(&self, seeds: &[[f64; 3]], criteria: Criteria) -> Option<Measured> {
        let measured = tasks::map(seeds.iter(), || (), |(), seed| self.settled(*seed, criteria.contrast));
        let allowed =
            measured.into_iter().flatten().filter(|m| m.excess >= criteria.share * self.facing(m.centre));
        allowed.reduce(|a, b| if b.excess > a.excess { b } else { a })
    }

    /// A candidate at the scale that holds it, seen from its own middle: a seed may be so far from it that only a wide cap
    /// reaches it.
    fn settled(&self, seed: [f64; 3], contrast: f64) -> Option<Measured> {
        let mut best = self.scaled(seed, contrast)?;
        while let Some(closer) = self.scaled(best.centre, contrast).filter(|closer| closer.scale < best.scale)
        {
            best = closer;
        }
        Some(best)
    }

    /// A candidate of this contrast at the scale that holds it: where the excess has stopped growing, the one that stands out most.
    fn scaled(&self, seed: [f64; 3], contrast: f64) -> Option<Measured> {
        let pixel = self.levels[0].cell_angle();
        let mut scales: Vec<f64> =
            SCALES.iter().map(|s| s.to_radians()).filter(|s| *s > 1.3 * PIXELS * pixel).collect();
        if PIXELS * pixel <= SCALES[5].to_radians() {
            scales.insert(0, (PIXELS * pixel).max(SCALES[0].to_radians()));
        }
        scales.dedup_by(|a, b| *a < 1.3 * *b);
        let all: Vec<_> = scales.iter().map(|s| measure(self.for_scale(*s), seed, *s)).collect();
        let growth = |at: usize| match (all[at], all.get(at + 1)) {
            (Some(a), Some(Some(b))) => Some(b.excess / a.excess - 1.0),
            _ => None,
        };
        let stands_out =
            |m: &Measured| m.excess / (m.scale * m.scale * m.background_luminance().max(f64::MIN_POSITIVE));
        // the top of a wide light may be too flat to be one by itself
        let enough = |m: &Measured| m.contrast() >= contrast;
        let stopped = (0..all.len()).filter(|at| growth(*at).is_some_and(|g| g < GROWTH));
        let stopped = stopped.filter_map(|at| Some((all[at]?, all[at + 1]))).filter(|(m, _)| enough(m));
        let stopped = stopped.reduce(|a, b| if stands_out(&b.0) > stands_out(&a.0) { b } else { a });
        // the rim of a disc that fills the cap lies partly outside
        let stopped =
            stopped.and_then(|(m, wider)| if m.filled() > FULL * m.scale { wider } else { Some(m) });
        let widest = || all.iter().flatten().next_back().copied();
        let found = stopped.or_else(|| {
            // it ends somewhere in the wider of the two
            let growing = (0..all.len()).filter_map(|at| Some((growth(at)?, all[at + 1]?)));
            let slowest = growing.filter(|(_, m)| enough(m)).reduce(|a, b| if b.0 < a.0 { b } else { a });
            slowest.map(|s| s.1).or_else(widest)
        });
        found.filter(enough)
    }

    /// Replaces what exceeds the background by the background; of a disc's surroundings, and of a glow's that is `centred`, only as far
    /// as they lie evenly about it.
    fn take(&mut self, measured: &Measured, centred: bool) -> Found {
        let full = self.view(0);
        let facing = self.facing(measured.centre);
        let (peak, clipped) = shape::top(full, measured);
        let pixel = self.levels[0].cell_angle();
        // of what is wide, one pixel says little
        let wide = measured.scale > FINE.to_radians();
        let fine = if wide { self.for_scale(measured.scale) } else { full };
        let (core, spread) = core_centre(fine, measured).unwrap_or((measured.centre, 0.0));
        let core = if angle(core, measured.centre) < measured.scale { core } else { measured.centre };
        let plain = |cell: &Cell| [0, 1, 2].map(|c| cell.radiance[c].min(measured.background[c]));
        let radius_of = |energy: [f64; 3]| {
            let over = if wide { measured.peak } else { peak - measured.background_luminance() };
            shape::radius(luminance_of(energy), over, spread, pixel)
        };
        let share = |energy: [f64; 3]| (luminance_of(energy) / facing).min(1.0) as f32;
        let (mut energy, mut moment) = sums(full, measured, plain);
        let (mut radius, mut radius_source) = radius_of(energy);
        let kind = Kind::of(radius as f32);
        let opposite = Opposite::new(self.levels[0].grid(), &self.pixels, measured, core, PIXELS * pixel);
        let even = |cell: &Cell| opposite.rest(cell, plain(cell));
        let is_even = kind == Kind::Disc || (centred && kind == Kind::Glow);
        let whole = [luminance_of(energy), f64::from(share(energy))];
        if is_even {
            (energy, moment) = sums(full, measured, even);
            (radius, radius_source) = radius_of(energy);
        }
        // the first moment of what is wide lights surfaces as it does
        let mut direction = core;
        if let Some(middle) = normalised(moment)
            && kind != Kind::Disc
        {
            direction = middle;
            if kind == Kind::Lobe {
                // of a disc the mean of the cosine is (1 + cos r)/2
                let mean = dot(moment, middle) / luminance_of(energy);
                radius = (2.0 * mean - 1.0).clamp(-1.0, 1.0).acos();
            }
        }
        let mut pixels = Vec::new();
        full.cap(measured.centre, measured.scale, |cell| {
            let rest = if is_even { even(&cell) } else { plain(&cell) };
            if rest != cell.radiance {
                pixels.push((cell.index, cell.radiance, rest));
            }
        });
        for (index, _, rest) in &pixels {
            self.pixels[*index] = *rest;
        }
        let rows = self.levels[0].pixel_rows(measured.centre, measured.scale);
        self.refresh(&rows);
        let order = self.changes.len();
        self.changes.push(Change { rows, pixels });
        let light = CompactLight {
            direction: direction.map(|c| c as f32),
            irradiance: energy.map(|e| e as f32),
            radius: radius as f32,
            radius_source,
            clipped,
        };
        let (share, core) = (share(energy), core.map(|c| c as f32));
        Found { light, kind, share, whole, core, peak, order, measured: *measured }
    }

    /// Undoes a taking, whatever was taken since.
    fn put_back(&mut self, order: usize) {
        let Change { rows, pixels } =
            std::mem::replace(&mut self.changes[order], Change { rows: 0..0, pixels: Vec::new() });
        for (index, before, after) in pixels {
            let pixel = &mut self.pixels[index];
            *pixel = [0, 1, 2]
                .map(|c| if pixel[c] == after[c] { before[c] } else { pixel[c] + (before[c] - after[c]) });
        }
        self.refresh(&rows);
    }

    /// Takes these rows of pixels into the coarser levels again.
    fn refresh(&mut self, rows: &Range<usize>) {
        for level in &mut self.levels {
            level.refresh(&self.pixels, rows.clone());
        }
    }

    /// Irradiance (luminance) of a surface that faces `direction`.
    fn facing(&self, direction: [f64; 3]) -> f64 {
        self.coarsest()
            .all()
            .map(|cell| {
                let cosine = dot(cell.direction, direction).max(0.0);
                cell.solid_angle * cosine * f64::from(luminance(cell.radiance))
            })
            .sum()
    }

    fn view(&self, level: usize) -> View<'_> {
        self.levels[level].view(&self.pixels)
    }

    fn coarsest(&self) -> View<'_> {
        self.view(self.levels.len() - 1)
    }

    /// The coarsest resolution that shows a cap of this radius.
    fn for_scale(&self, scale: f64) -> View<'_> {
        let fine = |level: &Level| level.cell_angle() <= scale / CELLS;
        self.view(self.levels.iter().rposition(fine).unwrap_or(0))
    }
}

/// Energy and first moment (luminance) of what a cap loses of whose cells this stays.
fn sums(view: View<'_>, measured: &Measured, rest: impl Fn(&Cell) -> [f32; 3]) -> ([f64; 3], [f64; 3]) {
    let (mut energy, mut moment) = ([0.0; 3], [0.0; 3]);
    view.cap(measured.centre, measured.scale, |cell| {
        let rest = rest(&cell);
        for c in 0..3 {
            energy[c] += cell.solid_angle * (f64::from(cell.radiance[c]) - f64::from(rest[c]));
        }
        let taken = f64::from(luminance(cell.radiance)) - f64::from(luminance(rest));
        moment = [0, 1, 2].map(|c| moment[c] + cell.solid_angle * taken * cell.direction[c]);
    });
    (energy, moment)
}
