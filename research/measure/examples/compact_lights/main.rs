//! How well compact lights are found, and what they are worth.
//!
//! `cargo run --release -p veni-research --example compact_lights -- suns COUNT WIDTH`: generated scenes, where the sun is known.
//!
//! `… -- harmonics FILE …`: irradiance by nine harmonics, alone and with lights of their own.
//!
//! `… -- number FILE …`: irradiance of a panorama encoded at D = 27 with the lights that were measured in it, by their number.
//!
//! `… -- time WIDTH`: seconds of all processors and of the wall for one generated panorama, reading left out.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

mod irradiance;
mod number;
mod suns;

use std::path::Path;
use std::time::Instant;

use veni_image::Panorama;
use veni_light::light::{EnvironmentMap, LightOptions};
use veni_light::sphere::Equirect;
use veni_light::{Error, Result};
use veni_synth::{Overrides, Scene, SkyKind, render};

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let usage = || {
        Error::invalid(
            "usage: compact_lights suns COUNT WIDTH | harmonics FILE … | number FILE … | time WIDTH",
        )
    };
    let number = |word: &str| word.parse::<usize>().map_err(|_| usage());
    match words.as_slice() {
        ["suns", count, width] => {
            suns::run(number(count)? as u64, number(width)?);
            Ok(())
        }
        ["harmonics", files @ ..] if !files.is_empty() => irradiance::run(files),
        ["number", files @ ..] if !files.is_empty() => number::run(files),
        ["time", width] => time(number(width)?),
        _ => Err(usage()),
    }
}

/// A clean panorama.
fn panorama(file: &str) -> Result<Panorama> {
    let mut panorama = Panorama::read(Path::new(file))?;
    panorama.sanitise()?;
    Ok(panorama)
}

fn time(width: usize) -> Result<()> {
    let scene = Scene::draw(1, 0, &Overrides { sky: Some(SkyKind::Cloudy), ..Overrides::default() });
    let small = render(&scene, Equirect::new(1024, 512));
    let grid = Equirect::new(width, width / 2);
    let pixels = small.resample(grid).into_pixels();
    for _ in 0..5 {
        let pixels = pixels.clone();
        let (begin, before) = (Instant::now(), processor());
        EnvironmentMap::new(grid, &pixels)?;
        let light = LightOptions::default().of_pixels(grid, pixels)?;
        let (wall, used) = (begin.elapsed().as_secs_f64(), processor() - before);
        println!("{width} wide: {} lights, {used:.2} processor seconds, {wall:.3} s", light.lights().len());
    }
    Ok(())
}

/// Seconds that all threads of this process have run, from Linux's accounts; 0 elsewhere.
fn processor() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    // user and system time, in hundredths of a second
    fields.skip(11).take(2).filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0
}
