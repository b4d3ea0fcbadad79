//! What a fit that weighs pixels by their light gains, and what it costs:
//! `cargo run --release -p veni-research --example light -- MODEL FOLDER FACTOR [WEIGHT …]`.
//!
//! Each panorama of FOLDER, at 128 × 64, is fitted on means of FACTOR × FACTOR pixels (1, 2 or 4) from the encoder's latent
//! with the model's own prior, once per energy weight (`Objective::Energy`; 0 is the plain squared
//! error of log radiance). Irradiance is that of surfaces facing 26 ways; its error is √⟨(ln E − ln E_true)²⟩ over the ways,
//! without any alignment.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::Path;

use burn::tensor::Device;
use rayon::prelude::*;
use veni_core::data::coarsen::{averaged, coarse_grid};
use veni_core::data::{Dataset, panorama_files};
use veni_core::fit::{FitConfig, FitDecoder, FitTarget, Objective, fit};
use veni_core::latent::Latent;
use veni_core::model::Model;
use veni_core::panorama::luminance;
use veni_core::panorama::metrics::{Alignment, scores, sun_error};
use veni_core::progress::Silent;
use veni_core::sphere::Equirect;
use veni_core::vae::Veni;
use veni_core::{Error, Result};

const GRID: Equirect = Equirect { width: 128, height: 64 };

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let usage = || {
        Error::invalid(
            "usage: light MODEL FOLDER FACTOR [WEIGHT …], FACTOR 1, 2 or 4, energy weights in 0..=1 [0 0.05 0.1 0.2 0.4]",
        )
    };
    let [model, folder, factor, weights @ ..] = arguments.as_slice() else { return Err(usage()) };
    let factor = factor.parse().ok().filter(|f| [1, 2, 4].contains(f)).ok_or_else(usage)?;
    let mut weights: Vec<f64> =
        weights.iter().map(|s| s.parse().map_err(|_| usage())).collect::<Result<_>>()?;
    if weights.is_empty() {
        weights = vec![0.0, 0.05, 0.1, 0.2, 0.4];
    }
    let model = Model::load(Path::new(model))?;
    let set = Dataset::load(&panorama_files(Path::new(folder), &Silent)?, GRID)?;
    println!("| energy weight | LDR PSNR | HDR PSNR | log RMSE | sun | irradiance |");
    println!("|---|---|---|---|---|---|");
    for weight in weights {
        let all = set
            .items()
            .iter()
            .map(|item| look(&model, &item.log_radiance, factor, weight))
            .collect::<Result<Vec<_>>>()?;
        let mean = |f: &dyn Fn(&Look) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
        let suns: Vec<_> = all.iter().filter_map(|look| look.sun).collect();
        println!(
            "| {weight} | {:.2} | {:.2} | {:.3} | {:.1}° | {:.3} |",
            mean(&|l| l.ldr_psnr),
            mean(&|l| l.hdr_psnr),
            mean(&|l| l.log_error),
            suns.iter().sum::<f64>() / suns.len() as f64,
            mean(&|l| l.irradiance),
        );
    }
    Ok(())
}

struct Look {
    ldr_psnr: f64,
    hdr_psnr: f64,
    log_error: f64,
    sun: Option<f64>,
    irradiance: f64,
}

fn look(model: &Model, image: &[f32], factor: usize, weight: f64) -> Result<Look> {
    let veni = Veni::from_model(model, &Device::flex())?;
    let start: Vec<_> = veni.encode(GRID, &[image])?.into_iter().map(|e| Latent::new(e.vectors)).collect();
    let (decoder, prior) = (model.decoder()?, model.prior());
    let coarse = averaged(GRID, image, factor);
    let images = [coarse.as_slice()];
    let target = FitTarget::panoramas(coarse_grid(GRID, factor), &images)?.with_prior(&prior);
    let objective = if weight > 0.0 { Objective::Energy { weight } } else { Objective::LogError };
    let prior_weight = FitConfig::prior_for(start[0].vectors.len());
    let config = FitConfig { objective, prior: prior_weight, ..FitConfig::thorough() };
    let found = fit(FitDecoder::from(&decoder), &target, &start, &config)?;
    let mut decoded = vec![[0.0; 3]; GRID.len()];
    decoder.condition(&found.latents[0])?.log_radiance_batch(&GRID.directions(), &mut decoded);
    let decoded = decoded.into_flattened();
    let scored = scores(&decoded, image, GRID.height, GRID.width, Alignment::Exposure);
    let error = decoded
        .iter()
        .zip(image)
        .enumerate()
        .map(|(k, (a, b))| GRID.solid_angle(k / (3 * GRID.width)) * f64::from(a - b).powi(2));
    Ok(Look {
        ldr_psnr: scored.ldr_psnr,
        hdr_psnr: scored.hdr_psnr,
        log_error: (error.sum::<f64>() / (3.0 * 4.0 * std::f64::consts::PI)).sqrt(),
        sun: sun_error(GRID, &decoded, image),
        irradiance: irradiance_error(&decoded, image),
    })
}

fn irradiance_error(a: &[f32], b: &[f32]) -> f64 {
    let ways = veni_research::ways();
    let square = |way: &[f32; 3]| (irradiance(a, way) / irradiance(b, way)).ln().powi(2);
    (ways.par_iter().map(square).sum::<f64>() / ways.len() as f64).sqrt()
}

fn irradiance(image: &[f32], normal: &[f32; 3]) -> f64 {
    let pixels = image.as_chunks::<3>().0.iter().zip(GRID.directions()).enumerate();
    let light = pixels.map(|(p, (rgb, direction))| {
        let cosine: f32 = direction.iter().zip(normal).map(|(d, n)| d * n).sum();
        GRID.solid_angle(p / GRID.width) * f64::from(cosine.max(0.0) * luminance(rgb.map(f32::exp)))
    });
    light.sum()
}
