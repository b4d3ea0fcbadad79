//! Suns of generated scenes, whose places are known, found by [`veni_light::light`].

use rayon::prelude::*;
use veni_light::light::{EnvironmentMap, Kind, Light, luminance};
use veni_light::sphere::Equirect;

use super::draw::Overrides;
use super::render::render;
use super::scene::{Scene, SkyKind};

const GRID: Equirect = Equirect { width: 512, height: 256 };
/// Degrees.
const PIXEL: f64 = 360.0 / 512.0;

fn degrees(a: [f32; 3], b: [f32; 3]) -> f64 {
    let (a, b) = (a.map(f64::from), b.map(f64::from));
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    cross.iter().map(|c| c * c).sum::<f64>().sqrt().atan2(dot).to_degrees()
}

/// For every scene whether its sun is seen, and of the one that was found how far off it is, and whether it is a disc.
fn looks(sky: SkyKind, count: u64) -> Vec<(bool, Option<(f64, bool)>)> {
    let overrides = Overrides { sky: Some(sky), ..Overrides::default() };
    let look = |index| {
        let scene = Scene::draw(2, index, &overrides);
        let panorama = render(&scene, GRID);
        let light = Light::of(EnvironmentMap::new(GRID, panorama.pixels()).unwrap());
        let (mut peak, mut around) = (0f32, 0f32);
        for (pixel, direction) in panorama.pixels().iter().zip(GRID.directions()) {
            match degrees(direction, scene.sun()) {
                angle if angle < 1.5 * PIXEL => peak = peak.max(luminance(*pixel)),
                angle if (2.0..6.0).contains(&angle) => around = around.max(luminance(*pixel)),
                _ => {}
            }
        }
        (
            peak > 20.0 * around,
            light.sun().map(|sun| (degrees(sun.direction, scene.sun()), sun.kind() == Kind::Disc)),
        )
    };
    (0..count).into_par_iter().map(look).collect()
}

#[test]
fn suns_are_found_within_a_pixel() {
    for sky in [SkyKind::Clear, SkyKind::Cloudy] {
        let all = looks(sky, 12);
        let seen: Vec<_> = all.iter().filter(|(seen, _)| *seen).collect();
        assert!(seen.len() >= 6, "{}: only {} suns are seen", sky.name(), seen.len());
        for (at, (_, off)) in seen.iter().enumerate() {
            let (off, _) = off.unwrap_or_else(|| panic!("{}: sun {at} was not found", sky.name()));
            assert!(off <= PIXEL, "{}: sun {at} is {off}° off, a pixel is {PIXEL}°", sky.name());
        }
        for (at, (seen, off)) in all.iter().enumerate() {
            assert!(
                // of a sun behind leaves, the brightest gap between them may be taken for its glow, but nothing for a disc
                *seen || off.is_none_or(|(off, disc)| off < 2.0 || !disc),
                "{}: scene {at} has a sun {off:?} off",
                sky.name()
            );
        }
    }
}

#[test]
fn an_overcast_sky_has_no_sun() {
    for (at, (_, off)) in looks(SkyKind::Overcast, 16).into_iter().enumerate() {
        assert_eq!(off, None, "scene {at} has a sun");
    }
}
