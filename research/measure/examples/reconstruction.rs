//! Scores a model on a folder of panoramas and draws what it does:
//! `cargo run --release -p veni-research --example reconstruction -- MODEL FOLDER [OVERVIEW.png]`.
//!
//! Prints Markdown: per panorama and in the mean, the autoencoder pass and a latent optimised for each panorama.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::Path;

use burn::tensor::Device;
use veni_core::LoadedModel;
use veni_core::data::Reconstruction;
use veni_core::data::{Dataset, Item, panorama_files};
use veni_core::latent::Latent;
use veni_core::model::Model;
use veni_core::output::Overwrite;
use veni_core::panorama::Panorama;
use veni_core::panorama::metrics::Alignment;
use veni_core::panorama::tonemap::Tonemap;
use veni_core::progress::Silent;
use veni_core::sphere::Equirect;
use veni_core::vae::Veni;
use veni_core::{Error, Result};
use veni_eval::codec::{Autoencoder, Codec, Optimised};
use veni_eval::fitting::FitSettings;
use veni_image::Sheet;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (model, folder, overview) = match arguments.as_slice() {
        [model, folder] => (model, folder, None),
        [model, folder, overview] => (model, folder, Some(Path::new(overview))),
        _ => return Err(Error::invalid("usage: reconstruction MODEL FOLDER [OVERVIEW.png]")),
    };
    let model = Model::load(Path::new(model))?;
    let veni = Veni::from_model(&model, &Device::flex())?;
    let set = Dataset::load(&panorama_files(Path::new(folder), &Silent)?, Equirect::new(128, 64))?;

    let loaded = LoadedModel::new("model", model.clone(), &Device::flex())?;
    let encoder = Autoencoder::new(&loaded).ok_or_else(|| Error::invalid("the model has no encoder"))?;
    let pass = scores(&encoder, &set)?;
    let best = scores(&Optimised::new(&loaded, FitSettings::thorough(set.grid(), false)), &set)?;
    println!("| panorama | LDR PSNR | HDR PSNR | SSIM | optimised LDR PSNR | HDR PSNR | SSIM |");
    println!("|---|---|---|---|---|---|---|");
    let row = |name: &str, a: &[f64; 3], b: &[f64; 3]| {
        println!(
            "| {name} | {:.2} | {:.2} | {:.3} | {:.2} | {:.2} | {:.3} |",
            a[0], a[1], a[2], b[0], b[1], b[2]
        );
    };
    for ((name, a), (_, b)) in pass.images.iter().zip(&best.images) {
        row(name, &[a.ldr_psnr, a.hdr_psnr, a.ssim], &[b.ldr_psnr, b.hdr_psnr, b.ssim]);
    }
    let (a, b) = (pass.mean, best.mean);
    row("**mean**", &[a.ldr_psnr, a.hdr_psnr, a.ssim], &[b.ldr_psnr, b.hdr_psnr, b.ssim]);

    let reference = reference_protocol(&veni, &set)?;
    println!(
        "\nThe autoencoder pass with the reference's factor on log radiance: LDR PSNR {:.2}, HDR PSNR {:.2}, SSIM {:.3}.",
        reference.mean.ldr_psnr, reference.mean.hdr_psnr, reference.mean.ssim
    );
    overview.map_or(Ok(()), |path| draw(path, &model, &veni, &set))
}

/// Exposure-aligned scores of what a codec makes of each panorama.
fn scores(codec: &dyn Codec, set: &Dataset) -> Result<Reconstruction> {
    Reconstruction::by_parts(set, Alignment::Exposure, |range| {
        let one = |item: &Item| codec.decode(set.grid(), &codec.encode(set.grid(), &item.log_radiance)?);
        set.items()[range].iter().map(one).collect()
    })
}

/// The reference implementation's protocol: its factor on log radiance as stored in the files, exposure included.
fn reference_protocol(veni: &Veni, set: &Dataset) -> Result<Reconstruction> {
    let images: Vec<_> = set.items().iter().map(|item| item.log_radiance.as_slice()).collect();
    let latents: Vec<_> = veni.encode(set.grid(), &images)?.into_iter().map(|e| e.vectors).collect();
    let mut decoded = veni.decode(set.grid(), &latents);
    let items = set.items().iter().zip(&mut decoded).map(|(item, decoded)| {
        decoded.iter_mut().for_each(|v| *v += item.log_exposure);
        let log_radiance = item.log_radiance.iter().map(|v| v + item.log_exposure).collect();
        Item { log_radiance, ..item.clone() }
    });
    let exposed = Dataset::new(set.grid(), items.collect());
    Ok(Reconstruction::compare(&exposed, &decoded, Alignment::LogFactor))
}

/// Target | reconstruction | random sky, a row per panorama.
fn draw(path: &Path, model: &Model, veni: &Veni, set: &Dataset) -> Result<()> {
    let grid = Equirect::new(256, 128);
    let mut sheet = Sheet::spaced(3, set.len(), [grid.width, grid.height], 4, [255; 3]);
    let (decoder, prior) = (model.decoder()?, model.prior());
    let images: Vec<_> = set.items().iter().map(|item| item.log_radiance.as_slice()).collect();
    let latents = veni.encode(set.grid(), &images)?.into_iter().map(|e| Latent::new(e.vectors));
    for (row, (item, latent)) in set.items().iter().zip(latents).enumerate() {
        let mut target = Panorama::read(&item.path)?;
        target.sanitise()?;
        let random = Latent::from_seed(&prior, row as u64);
        let [reconstruction, random] = [latent, random]
            .map(|z| decoder.condition(&z).map(|field| Panorama::new(grid, field.bake(grid))));
        for (column, panorama) in [target.resample(grid), reconstruction?, random?].into_iter().enumerate() {
            let tonemap = Tonemap::reference(&panorama);
            sheet.place(column, row, panorama.pixels().iter().map(|pixel| tonemap.apply_u8(*pixel)));
        }
    }
    sheet.write(path, Overwrite::Replace)
}
