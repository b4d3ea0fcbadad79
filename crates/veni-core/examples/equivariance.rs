//! How equivariant a model is, in numbers:
//! `cargo run --release -p veni-core --example equivariance -- MODEL FOLDER`.
//!
//! Prints Markdown. Encoder: |Z(turned image) − turned Z(image)| / |Z|, the worst over the folder's panoramas. Decoder and
//! whole: the largest difference of log radiance.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::f64::consts::TAU;
use std::path::Path;

use burn::tensor::Device;
use veni_core::data::augment::{mirror, turn_columns};
use veni_core::data::{Dataset, panorama_files};
use veni_core::field::Decoder;
use veni_core::latent::Latent;
use veni_core::model::Model;
use veni_core::sphere::Equirect;
use veni_core::vae::Veni;
use veni_core::{Error, Result};

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [model, folder] = arguments.as_slice() else {
        return Err(Error::invalid("usage: equivariance MODEL FOLDER"));
    };
    let model = Model::load(Path::new(model))?;
    let (veni, decoder) = (Veni::from_model(&model, &Device::flex())?, model.decoder()?);
    let grid = Equirect::new(128, 64);
    let set = Dataset::load(&panorama_files(Path::new(folder))?, grid)?;
    let images: Vec<_> = set.items().iter().map(|item| item.log_radiance.clone()).collect();
    let latents = encode(&veni, grid, &images)?;
    let stripe = grid.width / veni.stripes()?.stripes();

    println!("| encoder, relative error of the latent | worst | mean |");
    println!("|---|---|---|");
    for (name, columns) in [
        ("turned by one stripe", stripe),
        ("turned by a quarter", grid.width / 4),
        ("turned by half a stripe", stripe / 2),
        ("turned by 20½ stripes", 20 * stripe + stripe / 2),
    ] {
        if columns == 0 {
            continue;
        }
        let angle = -TAU * columns as f64 / grid.width as f64;
        let moved: Vec<_> =
            images.iter().map(|image| with(image, |i| turn_columns(grid, i, columns))).collect();
        report(name, &encode(&veni, grid, &moved)?, &latents, |z| z.turned(angle));
    }
    let mirrored: Vec<_> = images.iter().map(|image| with(image, |i| mirror(grid, i))).collect();
    report("mirrored", &encode(&veni, grid, &mirrored)?, &latents, Latent::mirrored);

    println!("\n| largest difference of log radiance | |");
    println!("|---|---|");
    println!("| decoder, latent turned against directions turned | {:.1e} |", turned(&decoder, &latents)?);
    println!(
        "| decoder, latent mirrored against directions mirrored | {:.1e} |",
        reflected(&decoder, &latents)?
    );
    let moved: Vec<_> =
        images.iter().map(|image| with(image, |i| turn_columns(grid, i, 5 * stripe))).collect();
    let again = veni.decode(grid, &vectors(&encode(&veni, grid, &moved)?));
    let once = veni.decode(grid, &vectors(&latents));
    let expected = once.iter().map(|image| with(image, |i| turn_columns(grid, i, 5 * stripe)));
    let worst = again.iter().zip(expected).map(|(a, b)| largest(a, &b)).fold(0.0, f32::max);
    println!("| whole model, five stripes | {worst:.1e} |");
    Ok(())
}

fn with(image: &[f32], change: impl Fn(&mut [f32])) -> Vec<f32> {
    let mut image = image.to_vec();
    change(&mut image);
    image
}

fn encode(veni: &Veni, grid: Equirect, images: &[Vec<f32>]) -> Result<Vec<Latent>> {
    let images: Vec<_> = images.iter().map(Vec::as_slice).collect();
    Ok(veni.encode(grid, &images)?.into_iter().map(|e| Latent::new(e.vectors)).collect())
}

fn vectors(latents: &[Latent]) -> Vec<Vec<[f32; 3]>> {
    latents.iter().map(|z| z.vectors.clone()).collect()
}

fn report(name: &str, ours: &[Latent], base: &[Latent], expected: impl Fn(&Latent) -> Latent) {
    let norm = |v: &[f32]| v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    let errors: Vec<_> = (ours.iter().zip(base))
        .map(|(z, base)| {
            let (z, want) = (z.vectors.as_flattened(), expected(base).vectors);
            let difference: Vec<_> = z.iter().zip(want.as_flattened()).map(|(a, b)| a - b).collect();
            norm(&difference) / norm(z)
        })
        .collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!("| {name} | {:.1e} | {mean:.1e} |", errors.iter().copied().fold(0.0, f64::max));
}

fn largest(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// The worst over latents, 36 angles and a grid of directions.
fn turned(decoder: &Decoder, latents: &[Latent]) -> Result<f32> {
    let mut worst = 0f32;
    for step in 0..36 {
        let angle = 0.01 + TAU * f64::from(step) / 36.0;
        let (sin, cos) = angle.sin_cos();
        worst = worst.max(against(
            decoder,
            latents,
            |z| z.turned(angle),
            |[x, y, z]| {
                let (x, y) = (f64::from(x), f64::from(y));
                [(x * cos - y * sin) as f32, (x * sin + y * cos) as f32, z]
            },
        )?);
    }
    Ok(worst)
}

fn reflected(decoder: &Decoder, latents: &[Latent]) -> Result<f32> {
    against(decoder, latents, Latent::mirrored, |[x, y, z]| [x, -y, z])
}

fn against(
    decoder: &Decoder,
    latents: &[Latent],
    latent: impl Fn(&Latent) -> Latent,
    direction: impl Fn([f32; 3]) -> [f32; 3],
) -> Result<f32> {
    let directions = Equirect::new(64, 32).directions();
    let moved: Vec<_> = directions.iter().map(|d| direction(*d)).collect();
    let mut worst = 0f32;
    for z in latents {
        let mut values = [vec![[0.0; 3]; moved.len()], vec![[0.0; 3]; moved.len()]];
        decoder.condition(z)?.log_radiance_batch(&directions, &mut values[0]);
        decoder.condition(&latent(z))?.log_radiance_batch(&moved, &mut values[1]);
        worst = worst.max(largest(values[0].as_flattened(), values[1].as_flattened()));
    }
    Ok(worst)
}
