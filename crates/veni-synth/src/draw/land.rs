//! What the ground is, and what stands at the horizon.

use crate::random::Draw;
use crate::scene::{Ridge, RidgeKind, Setting};
use crate::surface::{Ground, GroundMaterial, Pattern};

/// Surfaces by weight.
type Choices<'a> = &'a [(f32, GroundMaterial)];

/// The ground of a setting.
pub(super) fn ground(draw: &mut Draw, setting: Setting) -> Ground {
    use GroundMaterial::{Asphalt, DryGrass, Grass, Leaves, Paving, Rock, Sand, Snow, Soil, Water};
    let snow = draw.chance(0.06);
    let country = [(4.0, Grass), (2.5, DryGrass), (1.5, Soil), (0.8, Sand), (0.7, Rock), (0.3, Asphalt)];
    let (first, second): (Choices<'_>, Choices<'_>) = match setting {
        Setting::PureSky | Setting::Plain | Setting::Hills => {
            (&country, &[(1.0, Soil), (1.0, DryGrass), (0.6, Asphalt), (0.6, Rock), (1.0, Grass)])
        }
        Setting::Coast => (&[(2.0, Sand), (1.0, Rock), (0.7, Grass), (0.5, Paving)], &[(1.0, Water)]),
        Setting::Lake => (&[(2.0, Grass), (1.0, Sand), (1.0, DryGrass), (0.7, Rock)], &[(1.0, Water)]),
        Setting::Park => {
            (&[(4.0, Grass), (1.0, DryGrass), (0.5, Leaves)], &[(1.0, Paving), (1.0, Soil), (1.0, Asphalt)])
        }
        Setting::Forest => {
            (&[(2.0, Leaves), (2.0, Soil), (1.0, Grass)], &[(1.0, Soil), (1.0, Leaves), (1.0, Grass)])
        }
        Setting::Village => (&[(3.0, Grass), (1.0, Soil), (1.0, Paving)], &[(1.0, Asphalt), (1.0, Paving)]),
        Setting::Street => (&[(3.0, Paving), (1.0, Asphalt)], &[(3.0, Asphalt), (1.0, Paving)]),
        Setting::Square => {
            (&[(3.0, Paving), (1.0, Asphalt), (0.5, Grass)], &[(1.0, Paving), (1.0, Grass), (1.0, Asphalt)])
        }
        Setting::Courtyard => (&[(3.0, Paving), (1.0, Grass), (1.0, Soil)], &[(1.0, Paving), (1.0, Grass)]),
        Setting::Rocks => {
            (&[(2.0, Sand), (2.0, Rock), (1.0, Soil), (1.0, DryGrass)], &[(1.0, Rock), (1.0, Sand)])
        }
        Setting::Shelter => {
            (&[(2.0, Paving), (1.0, Asphalt), (1.0, Soil), (1.0, Grass)], &[(1.0, Grass), (1.0, Paving)])
        }
    };
    let (surface, second) = (draw.weighted(first), draw.weighted(second));
    let surface = if snow { Snow } else { surface };
    let patterns: &[(f32, Pattern)] = match setting {
        Setting::Coast | Setting::Lake => &[(1.0, Pattern::Shore)],
        Setting::Street => &[(1.0, Pattern::Strip)],
        Setting::Park | Setting::Village => {
            &[(1.5, Pattern::Patches), (1.0, Pattern::Strip), (0.4, Pattern::Rows), (0.6, Pattern::None)]
        }
        Setting::Square | Setting::Courtyard => {
            &[(1.5, Pattern::Patches), (0.6, Pattern::Strip), (0.4, Pattern::Rows), (1.5, Pattern::None)]
        }
        _ => &[(2.5, Pattern::Patches), (0.7, Pattern::Strip), (0.7, Pattern::Rows), (0.8, Pattern::None)],
    };
    let pattern = draw.weighted(patterns);
    let strip = draw.log_range(0.4, 4.0);
    let aside = draw.normal(0.0, 1.0);
    let shore = draw.range(-4.0, 16.0);
    Ground {
        surface,
        second,
        pattern,
        bearing: draw.azimuth().to_degrees(),
        width: if pattern == Pattern::Shore { shore } else { strip },
        offset: if setting == Setting::Street { 0.3 * aside } else { 2.0 * aside },
        tone: draw.normal(-0.52, 0.32).exp().min(if surface == Snow { 1.1 } else { 2.0 }),
        contrast: draw.normal(0.38, 0.4).exp().min(3.0),
        roughness: draw.range(0.0, 0.9),
        hollow: draw.range(0.1, 0.7),
        sheen: if draw.chance(0.5) { draw.range(0.0, 0.6) } else { 0.0 },
        wind: draw.log_range(0.4, 9.0),
        seed: draw.bits(),
    }
}

/// What closes the horizon of a setting.
pub(super) fn ridges(draw: &mut Draw, setting: Setting, ground: &Ground) -> Vec<Ridge> {
    let snowy = ground.surface == GroundMaterial::Snow;
    let mut out = Vec::new();
    let [hills, mountains, trees, town] = match setting {
        Setting::PureSky => [0.0; 4],
        Setting::Plain => [0.55, 0.15, 0.45, 0.1],
        Setting::Hills => [1.0, 0.5, 0.5, 0.05],
        Setting::Coast => [0.5, 0.25, 0.15, 0.15],
        Setting::Lake => [0.7, 0.4, 0.9, 0.05],
        Setting::Park => [0.2, 0.05, 0.9, 0.45],
        Setting::Forest => [0.2, 0.0, 1.0, 0.0],
        Setting::Village => [0.5, 0.2, 0.8, 0.4],
        Setting::Street | Setting::Square | Setting::Courtyard => [0.1, 0.05, 0.5, 1.0],
        Setting::Rocks => [0.6, 0.5, 0.2, 0.0],
        Setting::Shelter => [0.3, 0.1, 0.7, 0.4],
    };
    let wild = [
        (3.0, GroundMaterial::Grass),
        (1.5, GroundMaterial::DryGrass),
        (1.0, GroundMaterial::Rock),
        (1.0, GroundMaterial::Soil),
    ];
    let cover = if snowy { GroundMaterial::Snow } else { draw.weighted(&wild) };
    let count = if setting == Setting::Hills { 3 } else { 2 };
    for _ in 0..count {
        let distance = draw.log_range(350.0, 9000.0);
        let slope = draw.log_range(0.02, if setting == Setting::Hills { 0.3 } else { 0.13 });
        let ridge = Ridge {
            kind: RidgeKind::Hills,
            distance,
            height: distance * slope,
            relief: draw.range(0.3, 0.9),
            surface: cover,
            gaps: 0.0,
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
        gaps: 0.0,
        snow_line: if snowy { 0.0 } else { distance * draw.range(0.05, 0.5) },
        seed: draw.bits(),
    };
    if draw.chance(mountains) {
        out.push(range);
    }
    let [near, far] = if setting == Setting::Forest { [32.0, 60.0] } else { [55.0, 500.0] };
    let open = if setting == Setting::Forest { 0.0 } else { draw.unit() };
    let distance = draw.log_range(near, far);
    let wood = Ridge {
        kind: RidgeKind::Trees,
        distance,
        height: draw.range(6.0, 17.0) + if setting == Setting::Forest { 6.0 } else { 0.0 },
        relief: draw.range(0.35, 0.95) * if setting == Setting::Forest { 0.4 } else { 1.0 },
        surface: GroundMaterial::Grass,
        gaps: open,
        snow_line: 1e5,
        seed: draw.bits(),
    };
    if draw.chance(trees) {
        out.push(wood);
    }
    let distance = draw.log_range(60.0, 500.0);
    let open = draw.range(-0.3, 0.7).max(0.0);
    let skyline = Ridge {
        kind: RidgeKind::Town,
        distance,
        height: draw.log_range(8.0, 32.0),
        relief: draw.range(0.3, 0.7),
        surface: GroundMaterial::Paving,
        gaps: open,
        snow_line: 1e5,
        seed: draw.bits(),
    };
    if draw.chance(town) {
        out.push(skyline);
    }
    out
}
