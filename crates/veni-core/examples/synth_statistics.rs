//! How much generated skies look like photographed ones, in numbers and in pictures:
//! `cargo run --release -p veni-core --example synth_statistics -- FOLDER [COUNT [SEED [SHEETS]]]`
//!
//! FOLDER holds panoramas. Prints medians and quartiles of statistics of both sets at 128 × 64, each panorama at
//! exposure 0. SHEETS is a folder for `real.png` and `synthetic.png`, tonemapped alike (98 % quantile is white).

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use veni_core::panorama::tonemap::{Tonemap, quantile};
use veni_core::panorama::{Panorama, luminance};
use veni_core::sphere::Equirect;
use veni_core::synth::{Fixed, generate};

const GRID: Equirect = Equirect { width: 128, height: 64 };

/// The statistics of one panorama, by name.
fn statistics(panorama: &Panorama) -> Vec<(&'static str, f32)> {
    let exposure = panorama.mean_log_luminance();
    let log: Vec<f32> = panorama.pixels().iter().map(|p| luminance(*p).max(1e-30).ln() - exposure).collect();
    let weight = |k: usize| GRID.solid_angle(k / GRID.width);
    let mean = |rows: std::ops::Range<usize>, f: &dyn Fn(usize) -> f32| {
        let all = rows.start * GRID.width..rows.end * GRID.width;
        let total: f64 = all.clone().map(weight).sum();
        (all.map(|k| f64::from(f(k)) * weight(k)).sum::<f64>() / total) as f32
    };
    let ratio = |k: usize, a: usize, b: usize| {
        let p = panorama.pixels()[k];
        (p[a].max(1e-30) / p[b].max(1e-30)).ln()
    };
    // quantiles by solid angle: each row repeats in proportion
    let mut spread = Vec::new();
    for (k, v) in log.iter().enumerate() {
        let copies = (weight(k) / GRID.solid_angle(32) * 8.0).round().max(1.0) as usize;
        spread.extend(std::iter::repeat_n(*v, copies));
    }
    let q = |at: f64| quantile(&spread, at);
    let sd = |rows: std::ops::Range<usize>, f: &dyn Fn(usize) -> f32| {
        let m = mean(rows.clone(), f);
        mean(rows, &|k| (f(k) - m) * (f(k) - m)).sqrt()
    };
    let row_sd = (20..44).map(|j| sd(j..j + 1, &|k| log[k])).sum::<f32>() / 24.0;
    let step = |k: usize| (log[k] - log[k - k % 128 + (k + 1) % 128]).abs();
    let chroma = |k: usize| ratio(k, 2, 0);
    vec![
        ("sd of ln Y", sd(0..64, &|k| log[k])),
        ("ln Y, 1 %", q(0.01)),
        ("5 %", q(0.05)),
        ("25 %", q(0.25)),
        ("50 %", q(0.5)),
        ("75 %", q(0.75)),
        ("95 %", q(0.95)),
        ("99 %", q(0.99)),
        ("largest", q(1.0)),
        ("mean ln Y, 60° to 90°", mean(0..11, &|k| log[k])),
        ("30° to 60°", mean(11..21, &|k| log[k])),
        ("10° to 30°", mean(21..28, &|k| log[k])),
        ("0° to 10°", mean(28..32, &|k| log[k])),
        ("−10° to 0°", mean(32..36, &|k| log[k])),
        ("−30° to −10°", mean(36..43, &|k| log[k])),
        ("−90° to −30°", mean(43..64, &|k| log[k])),
        ("upper half less lower", mean(0..32, &|k| log[k]) - mean(32..64, &|k| log[k])),
        ("sd of ln Y along rows within 33° of the horizon", row_sd),
        ("neighbours' |Δ ln Y|, above", mean(4..32, &step)),
        ("neighbours' |Δ ln Y|, below", mean(32..60, &step)),
        ("mean ln R/G, above", mean(0..32, &|k| ratio(k, 0, 1))),
        ("mean ln R/G, below", mean(32..64, &|k| ratio(k, 0, 1))),
        ("mean ln B/G, above", mean(0..32, &|k| ratio(k, 2, 1))),
        ("mean ln B/G, below", mean(32..64, &|k| ratio(k, 2, 1))),
        ("sd of ln B/R", sd(0..64, &chroma)),
    ]
}

fn sheet(path: &Path, panoramas: &[Panorama]) -> Result<(), Box<dyn Error>> {
    let columns = 8;
    let rows = panoramas.len().div_ceil(columns);
    let (w, h) = (GRID.width as u32 + 4, GRID.height as u32 + 4);
    let mut out =
        image::RgbImage::from_pixel(columns as u32 * w + 4, rows as u32 * h + 4, image::Rgb([24; 3]));
    for (k, panorama) in panoramas.iter().enumerate() {
        let tonemap = Tonemap::reference(panorama);
        let (left, top) = ((k % columns) as u32 * w + 4, (k / columns) as u32 * h + 4);
        for (at, pixel) in panorama.pixels().iter().enumerate() {
            let (x, y) = ((at % GRID.width) as u32, (at / GRID.width) as u32);
            out.put_pixel(left + x, top + y, image::Rgb(tonemap.apply_u8(*pixel)));
        }
    }
    Ok(out.save(path)?)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut files =
        std::fs::read_dir(folder)?.map(|e| Ok(e?.path())).collect::<Result<Vec<_>, std::io::Error>>()?;
    files.retain(|p| p.extension().is_some_and(|e| e == "exr" || e == "hdr"));
    files.sort();
    Ok(files)
}

#[expect(clippy::print_stdout, reason = "this is what the example is for")]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let folder = arguments.first().ok_or("give a folder of panoramas")?;
    let count = arguments.get(1).map_or(Ok(200), |n| n.parse())?;
    let seed = arguments.get(2).map_or(Ok(0), |n| n.parse())?;
    let mut real = Vec::new();
    for file in files(Path::new(folder))? {
        let mut panorama = Panorama::read(&file)?;
        panorama.sanitise()?;
        real.push(panorama.resample(GRID));
    }
    let started = std::time::Instant::now();
    let made = Mutex::new(Vec::new());
    generate(
        seed,
        0..count,
        &Fixed::default(),
        GRID,
        |_| true,
        |scene, panorama| -> Result<(), String> {
            made.lock().map_err(|e| e.to_string())?.push((scene.index, panorama));
            Ok(())
        },
    )?;
    let mut made = made.into_inner()?;
    made.sort_by_key(|m| m.0);
    let made: Vec<_> = made.into_iter().map(|m| m.1).collect();
    eprintln!("{count} generated in {:.1} s", started.elapsed().as_secs_f64());
    if let Some(sheets) = arguments.get(3) {
        std::fs::create_dir_all(sheets)?;
        sheet(&Path::new(sheets).join("real.png"), &real[..real.len().min(64)])?;
        sheet(&Path::new(sheets).join("synthetic.png"), &made[..made.len().min(64)])?;
    }
    println!(
        "| of {} photographed and {count} generated | photographed | generated |\n|---|---|---|",
        real.len()
    );
    let [real, made] = [real, made].map(|set| set.iter().map(statistics).collect::<Vec<_>>());
    for k in 0..real[0].len() {
        let cell = |set: &[Vec<(&str, f32)>]| {
            let values: Vec<f32> = set.iter().map(|s| s[k].1).collect();
            let [low, middle, high] = [0.25, 0.5, 0.75].map(|at| quantile(&values, at));
            format!("{middle:.2} ({low:.2} to {high:.2})")
        };
        println!("| {} | {} | {} |", real[0][k].0, cell(&real), cell(&made));
    }
    Ok(())
}
