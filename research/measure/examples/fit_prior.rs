//! What the prior's weight in a fit costs and gives:
//! `cargo run --release -p veni-research --example fit_prior -- MODEL FOLDER SHEET.png [WEIGHT …]`.
//!
//! Each panorama of FOLDER is fitted at 64 × 32 from the encoder's latent, once per weight. Beside the scores stands what
//! becomes of ways between neighbouring panoramas' latents, (1 − t) Z₀ + t Z₁ in eight steps: the largest step over the mean
//! (root mean square differences of log radiance), the length of the way over the direct distance, and −ln p of latents and
//! of midpoints under the model's prior, per number. SHEET shows each way's ends and middle, one row per weight.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::Path;

use burn::tensor::Device;
use veni_core::data::coarsen::{averaged, coarse_grid};
use veni_core::data::{Dataset, panorama_files};
use veni_core::field::Decoder;
use veni_core::fit::{FitConfig, FitDecoder, FitTarget, fit};
use veni_core::latent::Latent;
use veni_core::model::Model;
use veni_core::panorama::metrics::{Alignment, log_error, scores};
use veni_core::progress::Silent;
use veni_core::sphere::Equirect;
use veni_core::vae::Veni;
use veni_core::{Error, Result};
use veni_eval::figure::{LabelledSheet, display};

const FULL: Equirect = Equirect { width: 128, height: 64 };
const STEPS: usize = 8;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let usage = || Error::invalid("usage: fit_prior MODEL FOLDER SHEET.png [WEIGHT …]");
    let [model, folder, sheet, weights @ ..] = arguments.as_slice() else { return Err(usage()) };
    let mut weights: Vec<f64> =
        weights.iter().map(|s| s.parse().map_err(|_| usage())).collect::<Result<_>>()?;
    if weights.is_empty() {
        weights = vec![0.0, 1e-6, 1e-5, 1e-4, 1e-3];
    }
    let model = Model::load(Path::new(model))?;
    let set = Dataset::load(&panorama_files(Path::new(folder), &Silent)?, FULL)?;
    let (decoder, prior) = (model.decoder()?, model.prior());
    let veni = Veni::from_model(&model, &Device::flex())?;
    let images: Vec<_> = set.items().iter().map(|item| item.log_radiance.as_slice()).collect();
    let starts: Vec<_> = veni.encode(FULL, &images)?.into_iter().map(|e| Latent::new(e.vectors)).collect();
    let coarse: Vec<_> = images.iter().map(|image| averaged(FULL, image, 2)).collect();
    let coarse: Vec<_> = coarse.iter().map(Vec::as_slice).collect();
    let grid = coarse_grid(FULL, 2);

    let names: Vec<_> = set.items().iter().map(veni_core::data::Item::name).collect();
    let rows: Vec<_> = weights.iter().map(|weight| format!("{weight}")).collect();
    let columns: Vec<_> =
        names.windows(2).flat_map(|n| [n[0].clone(), "middle".into(), n[1].clone()]).collect();
    let mut drawn = LabelledSheet::new(grid, &columns, &rows);
    println!(
        "| weight | log RMSE | LDR PSNR | largest step / mean | length / direct | −ln p of latents | of midpoints |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (row, weight) in weights.iter().enumerate() {
        let target = FitTarget::panoramas(grid, &coarse)?.with_prior(&prior);
        let config = FitConfig { prior: *weight, ..FitConfig::thorough() };
        let latents = fit(FitDecoder::from(&decoder), &target, &starts, &config)?.latents;
        let decode = |latent: &Latent| decoded(&decoder, latent, grid);
        let per = 3.0 * latents[0].vectors.len() as f64;
        let energy = |latent: &Latent| prior.energy(&latent.vectors).0 / per;
        let fitted = latents.iter().map(decode).collect::<Result<Vec<_>>>()?;
        let scored: Vec<_> = (fitted.iter().zip(&coarse))
            .map(|(a, b)| scores(a, b, grid.height, grid.width, Alignment::Exposure).ldr_psnr)
            .collect();
        let errors: Vec<_> = fitted.iter().zip(&coarse).map(|(a, b)| log_error(a, b).sqrt()).collect();
        let (mut largest, mut length, mut middles) = (Vec::new(), Vec::new(), Vec::new());
        for (at, pair) in latents.windows(2).enumerate() {
            let between = |k: usize| pair[0].lerp(&pair[1], k as f32 / STEPS as f32);
            let frames = (0..=STEPS).map(|k| decode(&between(k)?)).collect::<Result<Vec<_>>>()?;
            let steps: Vec<_> = frames.windows(2).map(|w| log_error(&w[0], &w[1]).sqrt()).collect();
            let sum: f64 = steps.iter().sum();
            largest.push(steps.iter().copied().fold(0.0, f64::max) * STEPS as f64 / sum);
            length.push(sum / log_error(&frames[0], &frames[STEPS]).sqrt());
            middles.push(energy(&between(STEPS / 2)?));
            for (column, frame) in [0, STEPS / 2, STEPS].into_iter().enumerate() {
                drawn.place(3 * at + column, row, &display(grid, &frames[frame]));
            }
        }
        let energies: Vec<_> = latents.iter().map(energy).collect();
        println!(
            "| {weight} | {:.3} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} |",
            mean(&errors),
            mean(&scored),
            mean(&largest),
            mean(&length),
            mean(&energies),
            mean(&middles)
        );
    }
    drawn.write(Path::new(sheet))
}

fn decoded(decoder: &Decoder, latent: &Latent, grid: Equirect) -> Result<Vec<f32>> {
    let mut out = vec![[0.0; 3]; grid.len()];
    decoder.condition(latent)?.log_radiance_batch(&grid.directions(), &mut out);
    Ok(out.into_flattened())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
