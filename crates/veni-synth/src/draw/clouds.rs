//! Which clouds a sky has.

use crate::cloud_layer::{CloudKind, CloudLayer};
use crate::random::Draw;
use crate::scene::SkyKind;

/// Cloud layers of this weather; `cover` if it is given.
pub(super) fn clouds(draw: &mut Draw, sky: SkyKind, cover: Option<f32>) -> Vec<CloudLayer> {
    let wind = draw.azimuth();
    let closed = sky == SkyKind::Overcast;
    let [low, stratus, high] = match sky {
        SkyKind::Clear => [0.08, 0.03, 0.3],
        SkyKind::Cloudy => [0.5, 0.4, 0.5],
        SkyKind::Overcast => [0.5, 1.0, 0.0],
        SkyKind::Sunset => [0.3, 0.3, 0.5],
        SkyKind::Night => [0.25, 0.2, 0.3],
    };
    let mut layers = Vec::new();
    let (with_low, with_stratus, with_high) = (draw.chance(low), draw.chance(stratus), draw.chance(high));
    let cumulus = CloudLayer {
        kind: CloudKind::Cumulus,
        base: draw.log_range(0.7, 2.2),
        thickness: draw.log_range(0.25, 1.6),
        cover: draw.range(0.06, 0.55),
        depth: draw.log_range(8.0, 50.0),
        scale: draw.log_range(1.2, 6.0),
        stretch: draw.range(1.0, 1.4),
        wind,
        ragged: draw.range(0.1, 0.7),
        cells: 0.0,
        seed: draw.bits(),
    };
    let middle = CloudLayer {
        kind: CloudKind::Stratus,
        base: if closed { draw.log_range(0.6, 3.0) } else { draw.log_range(2.2, 5.5) },
        thickness: 0.5,
        cover: if closed { 1.0 } else { draw.range(0.15, 0.8) },
        depth: if closed { draw.log_range(5.0, 40.0) } else { draw.log_range(1.0, 9.0) },
        scale: draw.log_range(2.5, 12.0),
        stretch: draw.log_range(1.0, 2.2),
        wind: wind + draw.normal(0.0, 0.6),
        ragged: draw.range(0.1, 0.6),
        cells: if draw.chance(0.3) { draw.range(0.1, 0.7) } else { 0.0 },
        seed: draw.bits(),
    };
    let cirrus = CloudLayer {
        kind: CloudKind::Stratus,
        base: draw.range(6.5, 10.5),
        thickness: 0.5,
        cover: draw.range(0.2, 0.8),
        depth: draw.log_range(0.12, 1.3),
        scale: draw.log_range(4.0, 16.0),
        stretch: draw.log_range(1.6, 5.0),
        wind: wind + draw.normal(0.0, 0.8),
        ragged: draw.range(0.2, 0.8),
        cells: if draw.chance(0.25) { draw.range(0.1, 0.6) } else { 0.0 },
        seed: draw.bits(),
    };
    for (present, layer) in [(with_low, cumulus), (with_stratus, middle), (with_high, cirrus)] {
        if present {
            layers.push(layer);
        }
    }
    if let Some(cover) = cover {
        if cover == 0.0 {
            return Vec::new();
        }
        if layers.is_empty() {
            // drawn again with the same numbers that a cloudy sky would have used
            return clouds_forced(draw, wind, cover);
        }
        layers.iter_mut().for_each(|d| d.cover = cover);
    }
    layers
}

/// A cumulus layer for a sky that drew no cloud but must have some.
fn clouds_forced(draw: &mut Draw, wind: f32, cover: f32) -> Vec<CloudLayer> {
    vec![CloudLayer {
        kind: CloudKind::Cumulus,
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
