//! Fits the baselines to every panorama of a folder, at 128 × 64, and prints their mean scores as Markdown:
//! `cargo run --release -p veni-research --example baselines -- FOLDER D [D …]`.
//!
//! Each cell is scored with an exposure factor first, then with the reference's factor on log radiance.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::Path;
use std::time::Instant;

use rayon::prelude::*;
use veni_core::data::Reconstruction;
use veni_core::data::{Dataset, panorama_files};
use veni_core::panorama::metrics::Alignment;
use veni_core::progress::Silent;
use veni_core::sphere::Equirect;
use veni_core::{Error, Result};
use veni_eval::baseline::{Baseline, BaselineKind, TargetSpace};

const SYSTEMS: [(&str, BaselineKind, TargetSpace); 5] = [
    ("spherical harmonics, log", BaselineKind::SphericalHarmonics, TargetSpace::Log),
    ("spherical harmonics, linear", BaselineKind::SphericalHarmonics, TargetSpace::Linear),
    ("spherical Gaussians, log", BaselineKind::SphericalGaussians, TargetSpace::Log),
    ("spherical Gaussians, linear", BaselineKind::SphericalGaussians, TargetSpace::Linear),
    ("Gaussian mixture", BaselineKind::GaussianMixture, TargetSpace::Linear),
];

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [folder, dimensions @ ..] = arguments.as_slice() else { return Err(usage()) };
    let dimensions: Vec<usize> =
        dimensions.iter().map(|d| d.parse().map_err(|_| usage())).collect::<Result<_>>()?;
    if dimensions.is_empty() {
        return Err(usage());
    }
    let set = Dataset::load(&panorama_files(Path::new(folder), &Silent)?, Equirect::new(128, 64))?;
    if set.is_empty() {
        return Err(Error::invalid(format!("{folder}: no .exr or .hdr panorama")));
    }
    println!("| system | D | numbers | LDR PSNR | HDR PSNR | SSIM | s per panorama |");
    println!("|---|---|---|---|---|---|---|");
    for (name, kind, space) in SYSTEMS {
        for &dimension in &dimensions {
            let baseline = Baseline::from_dimension(kind, dimension, space)?;
            let start = Instant::now();
            let images = fits(&baseline, &set)?;
            let seconds = start.elapsed().as_secs_f64() / set.len() as f64;
            let [exposure, factor] = [Alignment::Exposure, Alignment::LogFactor]
                .map(|alignment| Reconstruction::compare(&set, &images, alignment).mean);
            println!(
                "| {name} | {dimension} | {} | {:.2} / {:.2} | {:.2} / {:.2} | {:.3} / {:.3} | {seconds:.2} |",
                baseline.dimension(),
                exposure.ldr_psnr,
                factor.ldr_psnr,
                exposure.hdr_psnr,
                factor.hdr_psnr,
                exposure.ssim,
                factor.ssim,
            );
        }
    }
    Ok(())
}

fn usage() -> Error {
    Error::invalid("usage: baselines FOLDER D [D …], D the numbers a baseline may spend, such as 27 147 300")
}

/// One image of log radiance per panorama.
fn fits(baseline: &Baseline, set: &Dataset) -> Result<Vec<Vec<f32>>> {
    let directions = set.grid().directions();
    let fit = |item: &veni_core::data::Item| {
        let fitted = baseline.fit(set.grid(), &item.log_radiance).map_err(|e| e.in_file(&item.path))?;
        Ok(fitted.log_radiance(&directions).into_flattened())
    };
    set.items().par_iter().map(fit).collect()
}
