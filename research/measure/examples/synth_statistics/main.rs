//! How much generated skies look like photographed ones, in numbers and in pictures:
//! `cargo run --release -p veni-research --example synth_statistics -- FOLDER [COUNT [SEED [SHEETS]]]`
//!
//! FOLDER holds panoramas. Prints medians and quartiles of statistics of both sets at 128 × 64, each panorama at
//! exposure 0. SHEETS is a folder for `real.png` and `synthetic.png`, tonemapped alike (98 % quantile is white).

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use veni_core::panorama::Panorama;
use veni_core::panorama::tonemap::{Tonemap, quantile};
use veni_core::synth::{Overrides, generate};
use veni_image::Sheet;
use veni_light::output::Overwrite;

mod statistics;

use statistics::{GRID, statistics};

fn sheet(path: &Path, panoramas: &[Panorama]) -> Result<(), Box<dyn Error>> {
    let columns = 8;
    let mut out = Sheet::new(columns, panoramas.len().div_ceil(columns), GRID.width, GRID.height);
    for (k, panorama) in panoramas.iter().enumerate() {
        let tonemap = Tonemap::reference(panorama);
        out.place(k % columns, k / columns, panorama.pixels().iter().map(|pixel| tonemap.apply_u8(*pixel)));
    }
    Ok(out.write(path, Overwrite::Replace)?)
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
        &Overrides::default(),
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
            // what a panorama does not have is not a number
            let values: Vec<f32> = set.iter().map(|s| s[k].1).filter(|v| !v.is_nan()).collect();
            if set[0][k].0.ends_with("(mean)") {
                return format!("{:.2}", values.iter().sum::<f32>() / values.len() as f32);
            }
            let [low, middle, high] = [0.25, 0.5, 0.75].map(|at| quantile(&values, at));
            format!("{middle:.2} ({low:.2} to {high:.2})")
        };
        println!("| {} | {} | {} |", real[0][k].0, cell(&real), cell(&made));
    }
    Ok(())
}
