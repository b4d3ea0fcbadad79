//! Suns of generated scenes: how far off, how many missed, how many where none is.

use rayon::prelude::*;
use veni_light::light::{EnvironmentMap, Light, luminance};
use veni_light::sphere::Equirect;
use veni_synth::{Overrides, Scene, SkyKind, render};

/// A sun is seen where it outshines by this factor whatever is from 2° to 6° off.
const VISIBLE: f32 = 5.0;
/// A sun farther from the truth than this many pixels, 1.5° and its own radius is another light.
const PIXELS: f64 = 3.0;
/// A moon counts as seen by the same.
struct Row {
    seen: bool,
    moon: bool,
    error: Option<f64>,
    /// Radius of what was found, degrees.
    radius: f64,
    moon_error: Option<f64>,
}

pub(crate) fn run(count: u64, width: usize) {
    let grid = Equirect::new(width, width / 2);
    let pixel = 360.0 / width as f64;
    println!("{count} scenes of each kind, {width} × {}; errors in pixels of {pixel:.3}°", width / 2);
    println!("| scenes | sun seen | found | median | 90 % | worst | false | moon seen | taken for the sun |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for kind in SkyKind::ALL {
        let overrides = Overrides { sky: Some(kind), ..Overrides::default() };
        let rows: Vec<Row> =
            (0..count).into_par_iter().map(|k| look(&Scene::draw(1, k, &overrides), grid)).collect();
        let near = |r: &Row, e: f64| e <= (PIXELS * pixel).max(1.5).max(r.radius);
        let mut errors: Vec<f64> = rows
            .iter()
            .filter(|r| r.seen)
            .filter_map(|r| r.error.filter(|e| near(r, *e)))
            .map(|e| e / pixel)
            .collect();
        errors.sort_by(f64::total_cmp);
        let moons = rows.iter().filter(|r| r.moon_error.is_some_and(|e| near(r, e))).count();
        let false_suns = rows
            .iter()
            .filter(|r| r.error.is_some_and(|e| !near(r, e)) && !r.moon_error.is_some_and(|e| near(r, e)))
            .count();
        let at = |part: f64| match errors.len() {
            0 => "–".to_owned(),
            n => format!("{:.2}", errors[((n - 1) as f64 * part).round() as usize]),
        };
        println!(
            "| {} | {} | {} | {} | {} | {} | {false_suns} | {} | {moons} |",
            kind.name(),
            rows.iter().filter(|r| r.seen).count(),
            errors.len(),
            at(0.5),
            at(0.9),
            at(1.0),
            rows.iter().filter(|r| r.moon).count(),
        );
    }
}

fn look(scene: &Scene, grid: Equirect) -> Row {
    let panorama = render(scene, grid);
    let light = Light::of(EnvironmentMap::new(grid, panorama.pixels()).expect("a generated scene is clean"));
    let moon = scene.moon.map(|m| {
        let ((sa, ca), (se, ce)) = (m.azimuth.to_radians().sin_cos(), m.elevation.to_radians().sin_cos());
        [ce * ca, ce * sa, se]
    });
    let error = |truth: [f32; 3]| light.sun().map(|sun| degrees(sun.direction, truth));
    let seen = |truth: [f32; 3]| visible(grid, panorama.pixels(), truth);
    Row {
        seen: scene.sun_elevation > -0.5 && seen(scene.sun()),
        moon: moon.is_some_and(seen),
        error: error(scene.sun()),
        radius: light.sun().map_or(0.0, |sun| f64::from(sun.radius.to_degrees())),
        moon_error: moon.and_then(error),
    }
}

fn visible(grid: Equirect, pixels: &[[f32; 3]], truth: [f32; 3]) -> bool {
    let inner = (1.5 * 180.0 / grid.height as f64).max(0.5);
    let (mut peak, mut around) = (0f32, 0f32);
    for (pixel, direction) in pixels.iter().zip(grid.directions()) {
        let angle = degrees(direction, truth);
        if angle <= inner {
            peak = peak.max(luminance(*pixel));
        } else if (inner.max(2.0)..inner.max(2.0) + 4.0).contains(&angle) {
            around = around.max(luminance(*pixel));
        }
    }
    peak > VISIBLE * around
}

fn degrees(a: [f32; 3], b: [f32; 3]) -> f64 {
    let (a, b) = (a.map(f64::from), b.map(f64::from));
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    cross.iter().map(|c| c * c).sum::<f64>().sqrt().atan2(dot).to_degrees()
}
