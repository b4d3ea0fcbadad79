//! Irradiance of an encoded panorama with the lights that were measured in it: √⟨(ln(E/E_true))²⟩ over 26 ways, no alignment.

use rayon::prelude::*;
use veni_fit::Encoder;
use veni_image::{Panorama, luminance};
use veni_light::Result;
use veni_light::latent::Latent;
use veni_light::light::{CompactLight, EnvironmentMap, LightOptions};
use veni_light::model::Model;
use veni_light::sphere::Equirect;

use super::irradiance::exact;
use super::panorama;

const GRID: Equirect = Equirect { width: 128, height: 64 };
const NUMBERS: [usize; 5] = [0, 1, 2, 4, 8];
/// Largest angular radii, degrees.
const WIDEST: [f32; 4] = [1.5, 3.0, 6.0, 180.0];

pub(crate) fn run(files: &[&str]) -> Result<()> {
    let model = Model::pretrained();
    let encoder = Encoder::new(&model)?;
    println!(
        "| lights | of at most | whole encoded, lights added | residual encoded, lights added | worst of these |"
    );
    println!("|---|---|---|---|---|");
    for (most, widest) in NUMBERS.into_iter().flat_map(|most| WIDEST.map(|widest| (most, widest))) {
        let errors = files
            .par_iter()
            .map(|file| {
                let whole = panorama(file)?;
                let options =
                    LightOptions { lights: most, widest: widest.to_radians(), ..LightOptions::default() };
                let light = options.of(whole.environment()?)?;
                let residual = Panorama::new(whole.grid(), light.residual().pixels().to_vec());
                let error = |encoded: &Panorama| -> Result<f64> {
                    let field = decoded(&model, &encoder, encoded)?;
                    Ok(error(&field, light.lights(), whole.environment()?))
                };
                Ok([error(&whole)?, error(&residual)?])
            })
            .collect::<Result<Vec<_>>>()?;
        let rms = |k: usize| (errors.iter().map(|e| e[k] * e[k]).sum::<f64>() / errors.len() as f64).sqrt();
        let worst = errors.iter().map(|e| e[1]).fold(0.0, f64::max);
        println!("| {most} | {widest}° | {:.3} | {:.3} | {worst:.3} |", rms(0), rms(1));
    }
    Ok(())
}

/// What the model makes of a panorama.
fn decoded(model: &Model, encoder: &Encoder, panorama: &Panorama) -> Result<Vec<[f32; 3]>> {
    let small = panorama.resample(GRID);
    let log_exposure = small.mean_log_luminance();
    let image: Vec<f32> = small.log().as_flattened().iter().map(|v| v - log_exposure).collect();
    let vectors = encoder.encode(GRID, &[&image])?.remove(0).vectors;
    let latent = Latent { log_exposure, ..Latent::new(vectors) };
    Ok(model.decoder()?.condition(&latent)?.bake(GRID))
}

fn error(field: &[[f32; 3]], lights: &[CompactLight], truth: EnvironmentMap<'_>) -> f64 {
    let ways = veni_research::ways();
    let y = |e: [f64; 3]| f64::from(luminance(e.map(|v| v as f32)));
    let square = |way: &[f32; 3]| {
        let field = EnvironmentMap::new(GRID, field)
            .map(|map| y(exact(map, &GRID.directions(), *way)))
            .unwrap_or(f64::NAN);
        let lights: f32 = lights.iter().map(|l| luminance(l.irradiance_on(*way))).sum();
        ((field + f64::from(lights)) / y(exact(truth, &truth.grid().directions(), *way))).ln().powi(2)
    };
    (ways.iter().map(square).sum::<f64>() / ways.len() as f64).sqrt()
}
