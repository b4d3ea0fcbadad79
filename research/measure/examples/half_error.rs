//! What half precision costs panoramas: the mean relative error of their values, as they are and times the power of two that
//! suits each best.
//!
//! ```sh
//! cargo run --release -p veni-research --example half_error -- PANORAMA…
//! ```

#![allow(clippy::print_stdout, reason = "results go to stdout")]

use std::path::PathBuf;

use veni_image::{Panorama, half_error};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    if files.is_empty() {
        return Err("usage: half_error PANORAMA…".into());
    }
    let mut worst = [0.0_f64; 2];
    for file in &files {
        let panorama = Panorama::read(file)?;
        let pixels = panorama.pixels();
        let error = |power: i32| half_error(pixels, (power as f32).exp2());
        let errors = [error(0), (-30..=30).map(error).fold(f64::INFINITY, f64::min)];
        println!("{:.2e} {:.2e} {}", errors[0], errors[1], file.display());
        worst = [0, 1].map(|k| worst[k].max(errors[k]));
    }
    println!("{:.2e} {:.2e} at worst of {}", worst[0], worst[1], files.len());
    Ok(())
}
