//! The distribution of scenes.
//!
//! Weather, time of day and place are drawn first, everything else given these. The shares were set by hand so that
//! statistics of log radiance agree with those of photographed outdoor panoramas (`docs/RESULTS.md`, Synthetic skies).

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::cloud::{Deck, DeckKind};
use super::random::{Draw, Stream};
use super::scene::{Ground, Moon, Pattern, Place, Ridge, RidgeKind, Scene, SkyKind, Surface};
use crate::{Error, Result};

/// What is given rather than drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fixed {
    /// Weather or time of day.
    pub sky: Option<SkyKind>,
    /// What stands around the viewer.
    pub place: Option<Place>,
    /// Elevation of the sun, degrees.
    pub sun_elevation: Option<f32>,
    /// Azimuth of the sun, degrees from +x towards +y.
    pub sun_azimuth: Option<f32>,
    /// Turbidity, 1 to 12.
    pub turbidity: Option<f32>,
    /// Share of the sky that is cloud, 0 to 1.
    pub cloud_cover: Option<f32>,
    /// Multiplies the albedo of the ground so that its luminance is this, 0 to 0.95.
    pub ground_albedo: Option<f32>,
}

impl Fixed {
    /// Checks every number.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first one that is out of its range.
    pub fn check(&self) -> Result<()> {
        let ranges = [
            ("sun elevation", self.sun_elevation, -90.0, 90.0, "degrees"),
            ("sun azimuth", self.sun_azimuth, -360.0, 360.0, "degrees"),
            ("turbidity", self.turbidity, 1.0, 12.0, "(2 is very clear, 10 murky)"),
            ("cloud cover", self.cloud_cover, 0.0, 1.0, "(a share of the sky)"),
            ("ground albedo", self.ground_albedo, 0.0, 0.95, "(a share of the light)"),
        ];
        for (name, value, low, high, unit) in ranges {
            if value.is_some_and(|v| !(low..=high).contains(&v)) {
                let value = value.unwrap_or_default();
                return Err(Error::invalid(format!("{name} {value}: give {low} to {high} {unit}")));
            }
        }
        Ok(())
    }
}

impl Scene {
    /// Scene `index` of the set with this seed. Scenes of a set do not depend on each other, and what is not `fixed`
    /// does not depend on what is, except where it must (the colour of dusk on the height of the sun).
    pub fn draw(seed: u64, index: u64, fixed: &Fixed) -> Self {
        let mut draw = Draw::new(seed, index, Stream::Scene);
        let draw = &mut draw;
        let sky = draw.weighted(&[
            (0.29, SkyKind::Clear),
            (0.23, SkyKind::Cloudy),
            (0.13, SkyKind::Overcast),
            (0.25, SkyKind::Sunset),
            (0.10, SkyKind::Night),
        ]);
        let sky = fixed.sky.unwrap_or(sky);
        let place = draw.weighted(&[
            (0.17, Place::PureSky),
            (0.15, Place::Plain),
            (0.10, Place::Hills),
            (0.05, Place::Coast),
            (0.06, Place::Lake),
            (0.10, Place::Park),
            (0.09, Place::Forest),
            (0.08, Place::Village),
            (0.09, Place::Street),
            (0.07, Place::Square),
            (0.03, Place::Courtyard),
            (0.04, Place::Rocks),
            (0.04, Place::Shelter),
        ]);
        let place = fixed.place.unwrap_or(place);
        let elevation = elevation(draw, sky);
        let sun_elevation = fixed.sun_elevation.unwrap_or(elevation);
        let azimuth = draw.azimuth().to_degrees();
        let haze = draw.normal(0.0, 0.35).exp();
        let turbidity = (if sky == SkyKind::Overcast { 3.4 } else { 2.25 } * haze).clamp(1.7, 9.0);
        let clouds = clouds(draw, sky, fixed.cloud_cover);
        let moon = moon(draw, sun_elevation);
        let settled =
            matches!(place, Place::Street | Place::Square | Place::Courtyard | Place::Village | Place::Park);
        let glow = draw.log_range(5e-7, 2e-4) * if settled { 3.0 } else { 0.5 };
        let warm = draw.range(0.0, 1.0);
        let mut ground = ground(draw, place);
        if let Some(albedo) = fixed.ground_albedo {
            ground.tone = 1.0;
            ground.tone = albedo / crate::panorama::luminance(ground.albedo()).max(1e-4);
        }
        let ridges = ridges(draw, place, &ground);
        // what the camera leaves of a coloured cast: it takes the light of noon as white, more or less
        let cast = draw.normal(-0.22, 0.16);
        let tint = draw.normal(0.0, 0.03);
        let white = [(0.4 * cast).exp(), tint.exp(), (-0.8 * cast).exp()];
        Self {
            seed,
            index,
            sky,
            sun_elevation,
            sun_azimuth: fixed.sun_azimuth.unwrap_or(azimuth),
            turbidity: fixed.turbidity.unwrap_or(turbidity),
            ozone: draw.range(240.0, 420.0),
            moon,
            clouds,
            glow: (glow * Vec3::new(1.3, 0.85, 0.4).lerp(Vec3::new(1.0, 0.95, 0.85), warm)).to_array(),
            place,
            fullness: draw.unit().powf(0.7),
            eye: eye(draw, place),
            ground,
            ridges,
            lit: sun_elevation < 0.5 && (settled || draw.chance(0.3)),
            white,
        }
    }
}

fn elevation(draw: &mut Draw, sky: SkyKind) -> f32 {
    // one draw in every case, so that what follows stays the same when the sky is fixed
    let u = draw.unit();
    let between = |low: f32, high: f32| low + (high - low) * u;
    match sky {
        SkyKind::Clear | SkyKind::Cloudy => {
            between(9f32.to_radians().sin(), 78f32.to_radians().sin()).asin().to_degrees()
        }
        SkyKind::Overcast => between(4.0, 65.0),
        // more of it just above the horizon
        SkyKind::Sunset => -4.5 + 14.0 * u.powf(0.9),
        SkyKind::Night => between(-40.0, -10.0),
    }
}

fn moon(draw: &mut Draw, sun_elevation: f32) -> Option<Moon> {
    let up = draw.chance(0.6);
    let moon = Moon {
        elevation: draw.range(6.0, 65.0),
        azimuth: draw.azimuth().to_degrees(),
        phase: draw.range(-100.0, 100.0),
    };
    (up && sun_elevation < -8.0).then_some(moon)
}

fn clouds(draw: &mut Draw, sky: SkyKind, cover: Option<f32>) -> Vec<Deck> {
    let wind = draw.azimuth();
    let closed = sky == SkyKind::Overcast;
    let [low, sheet, high] = match sky {
        SkyKind::Clear => [0.08, 0.03, 0.3],
        SkyKind::Cloudy => [0.65, 0.35, 0.45],
        SkyKind::Overcast => [0.5, 1.0, 0.0],
        SkyKind::Sunset => [0.3, 0.3, 0.5],
        SkyKind::Night => [0.25, 0.2, 0.3],
    };
    let mut decks = Vec::new();
    let (with_low, with_sheet, with_high) = (draw.chance(low), draw.chance(sheet), draw.chance(high));
    let heap = Deck {
        kind: DeckKind::Heap,
        base: draw.log_range(0.7, 2.2),
        thickness: draw.log_range(0.25, 1.6),
        cover: draw.range(0.06, 0.62),
        depth: draw.log_range(8.0, 50.0),
        scale: draw.log_range(0.7, 4.0),
        stretch: draw.range(1.0, 1.4),
        wind,
        ragged: draw.range(0.25, 1.0),
        cells: 0.0,
        seed: draw.bits(),
    };
    let middle = Deck {
        kind: DeckKind::Sheet,
        base: if closed { draw.log_range(0.6, 3.0) } else { draw.log_range(2.2, 5.5) },
        thickness: 0.5,
        cover: if closed { 1.0 } else { draw.range(0.15, 0.8) },
        depth: if closed { draw.log_range(5.0, 40.0) } else { draw.log_range(1.0, 9.0) },
        scale: draw.log_range(1.5, 7.0),
        stretch: draw.log_range(1.0, 2.2),
        wind: wind + draw.normal(0.0, 0.6),
        ragged: draw.range(0.2, 0.9),
        cells: if draw.chance(0.5) { draw.range(0.2, 1.0) } else { 0.0 },
        seed: draw.bits(),
    };
    let cirrus = Deck {
        kind: DeckKind::Sheet,
        base: draw.range(6.5, 10.5),
        thickness: 0.5,
        cover: draw.range(0.2, 0.8),
        depth: draw.log_range(0.12, 1.3),
        scale: draw.log_range(2.5, 9.0),
        stretch: draw.log_range(1.6, 5.0),
        wind: wind + draw.normal(0.0, 0.8),
        ragged: draw.range(0.4, 1.0),
        cells: if draw.chance(0.25) { draw.range(0.1, 0.6) } else { 0.0 },
        seed: draw.bits(),
    };
    for (present, deck) in [(with_low, heap), (with_sheet, middle), (with_high, cirrus)] {
        if present {
            decks.push(deck);
        }
    }
    if let Some(cover) = cover {
        if cover == 0.0 {
            return Vec::new();
        }
        if decks.is_empty() {
            // drawn again with the same numbers that a cloudy sky would have used
            return clouds_forced(draw, wind, cover);
        }
        decks.iter_mut().for_each(|d| d.cover = cover);
    }
    decks
}

/// A deck of heaps for a sky that drew no cloud but must have some.
fn clouds_forced(draw: &mut Draw, wind: f32, cover: f32) -> Vec<Deck> {
    vec![Deck {
        kind: DeckKind::Heap,
        base: 1.3,
        thickness: 0.6,
        cover,
        depth: 20.0,
        scale: 1.8,
        stretch: 1.2,
        wind,
        ragged: 0.6,
        cells: 0.0,
        seed: draw.bits(),
    }]
}

/// Surfaces by weight.
type Choices<'a> = &'a [(f32, Surface)];

fn ground(draw: &mut Draw, place: Place) -> Ground {
    use Surface::{Asphalt, DryGrass, Grass, Leaves, Paving, Rock, Sand, Snow, Soil, Water};
    let snow = draw.chance(0.06);
    let country = [(4.0, Grass), (2.5, DryGrass), (1.5, Soil), (0.8, Sand), (0.7, Rock), (0.3, Asphalt)];
    let (first, second): (Choices<'_>, Choices<'_>) = match place {
        Place::PureSky | Place::Plain | Place::Hills => {
            (&country, &[(1.0, Soil), (1.0, DryGrass), (0.6, Asphalt), (0.6, Rock), (1.0, Grass)])
        }
        Place::Coast => (&[(2.0, Sand), (1.0, Rock), (0.7, Grass), (0.5, Paving)], &[(1.0, Water)]),
        Place::Lake => (&[(2.0, Grass), (1.0, Sand), (1.0, DryGrass), (0.7, Rock)], &[(1.0, Water)]),
        Place::Park => {
            (&[(4.0, Grass), (1.0, DryGrass), (0.5, Leaves)], &[(1.0, Paving), (1.0, Soil), (1.0, Asphalt)])
        }
        Place::Forest => {
            (&[(2.0, Leaves), (2.0, Soil), (1.0, Grass)], &[(1.0, Soil), (1.0, Leaves), (1.0, Grass)])
        }
        Place::Village => (&[(3.0, Grass), (1.0, Soil), (1.0, Paving)], &[(1.0, Asphalt), (1.0, Paving)]),
        Place::Street => (&[(3.0, Paving), (1.0, Asphalt)], &[(3.0, Asphalt), (1.0, Paving)]),
        Place::Square => {
            (&[(3.0, Paving), (1.0, Asphalt), (0.5, Grass)], &[(1.0, Paving), (1.0, Grass), (1.0, Asphalt)])
        }
        Place::Courtyard => (&[(3.0, Paving), (1.0, Grass), (1.0, Soil)], &[(1.0, Paving), (1.0, Grass)]),
        Place::Rocks => {
            (&[(2.0, Sand), (2.0, Rock), (1.0, Soil), (1.0, DryGrass)], &[(1.0, Rock), (1.0, Sand)])
        }
        Place::Shelter => {
            (&[(2.0, Paving), (1.0, Asphalt), (1.0, Soil), (1.0, Grass)], &[(1.0, Grass), (1.0, Paving)])
        }
    };
    let (surface, second) = (draw.weighted(first), draw.weighted(second));
    let surface = if snow { Snow } else { surface };
    let patterns: &[(f32, Pattern)] = match place {
        Place::Coast | Place::Lake => &[(1.0, Pattern::Shore)],
        Place::Street => &[(1.0, Pattern::Strip)],
        Place::Park | Place::Village => {
            &[(1.0, Pattern::Patches), (1.2, Pattern::Strip), (1.0, Pattern::None)]
        }
        Place::Square | Place::Courtyard => &[(1.0, Pattern::Patches), (2.0, Pattern::None)],
        _ => &[(2.0, Pattern::Patches), (0.7, Pattern::Strip), (1.5, Pattern::None)],
    };
    let pattern = draw.weighted(patterns);
    let strip = draw.log_range(0.6, 5.0);
    let shore = draw.range(-4.0, 16.0);
    Ground {
        surface,
        second,
        pattern,
        bearing: draw.azimuth().to_degrees(),
        width: if pattern == Pattern::Shore { shore } else { strip },
        tone: draw.normal(-0.2, 0.27).exp().min(if surface == Snow { 1.1 } else { 2.0 }),
        wind: draw.log_range(0.4, 9.0),
        seed: draw.bits(),
    }
}

fn ridges(draw: &mut Draw, place: Place, ground: &Ground) -> Vec<Ridge> {
    let snowy = ground.surface == Surface::Snow;
    let mut out = Vec::new();
    let [hills, mountains, trees, town] = match place {
        Place::PureSky => [0.0; 4],
        Place::Plain => [0.55, 0.15, 0.45, 0.1],
        Place::Hills => [1.0, 0.5, 0.5, 0.05],
        Place::Coast => [0.5, 0.25, 0.15, 0.15],
        Place::Lake => [0.7, 0.4, 0.9, 0.05],
        Place::Park => [0.2, 0.05, 0.9, 0.45],
        Place::Forest => [0.2, 0.0, 1.0, 0.0],
        Place::Village => [0.5, 0.2, 0.8, 0.4],
        Place::Street | Place::Square | Place::Courtyard => [0.1, 0.05, 0.5, 1.0],
        Place::Rocks => [0.6, 0.5, 0.2, 0.0],
        Place::Shelter => [0.3, 0.1, 0.7, 0.4],
    };
    let wild = [(3.0, Surface::Grass), (1.5, Surface::DryGrass), (1.0, Surface::Rock), (1.0, Surface::Soil)];
    let cover = if snowy { Surface::Snow } else { draw.weighted(&wild) };
    let count = if place == Place::Hills { 3 } else { 2 };
    for _ in 0..count {
        let distance = draw.log_range(350.0, 9000.0);
        let slope = draw.log_range(0.02, if place == Place::Hills { 0.3 } else { 0.13 });
        let ridge = Ridge {
            kind: RidgeKind::Hills,
            distance,
            height: distance * slope,
            relief: draw.range(0.3, 0.9),
            surface: cover,
            snow_line: if snowy { 0.0 } else { 1e5 },
            seed: draw.bits(),
        };
        if draw.chance(hills) {
            out.push(ridge);
        }
    }
    let distance = draw.log_range(4000.0, 30_000.0);
    let range = Ridge {
        kind: RidgeKind::Mountains,
        distance,
        height: distance * draw.log_range(0.05, 0.28),
        relief: draw.range(0.35, 0.8),
        surface: cover,
        snow_line: if snowy { 0.0 } else { distance * draw.range(0.05, 0.5) },
        seed: draw.bits(),
    };
    if draw.chance(mountains) {
        out.push(range);
    }
    let [near, far] = if place == Place::Forest { [32.0, 60.0] } else { [45.0, 320.0] };
    let distance = draw.log_range(near, far);
    let wood = Ridge {
        kind: RidgeKind::Trees,
        distance,
        height: draw.range(6.0, 17.0) + if place == Place::Forest { 6.0 } else { 0.0 },
        relief: draw.range(0.35, 0.95) * if place == Place::Forest { 0.4 } else { 1.0 },
        surface: Surface::Grass,
        snow_line: 1e5,
        seed: draw.bits(),
    };
    if draw.chance(trees) {
        out.push(wood);
    }
    let distance = draw.log_range(60.0, 500.0);
    let skyline = Ridge {
        kind: RidgeKind::Town,
        distance,
        height: draw.log_range(8.0, 32.0),
        relief: draw.range(0.3, 0.7),
        surface: Surface::Paving,
        snow_line: 1e5,
        seed: draw.bits(),
    };
    if draw.chance(town) {
        out.push(skyline);
    }
    out
}

fn eye(draw: &mut Draw, place: Place) -> f32 {
    let (low, high, raised) = (draw.range(1.2, 2.0), draw.log_range(3.0, 25.0), draw.unit());
    let often = match place {
        Place::Hills | Place::Coast => 0.25,
        Place::Plain => 0.15,
        _ => 0.0,
    };
    if raised < often { high } else { low }
}
