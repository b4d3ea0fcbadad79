//! The light around a photograph: a code is fitted to what the photograph shows of the sphere, and completes the rest.
//!
//! ```sh
//! cargo run --release -p veni-fit --example 4_fit_a_photograph
//! ```
//!
//! The "photograph" is a view of a panorama of assets/, so that what lies behind the camera can be compared. Writes
//! `truth.png` and `completed.png`.

#![allow(clippy::print_stdout, reason = "an example")]

use veni_fit::{FitConfig, Observation, best_of, random_starts};
use veni_image::tonemap::Tonemap;
use veni_image::{Panorama, Picture, WriteFormat, WriteOptions};
use veni_light::model::Model;
use veni_light::output::Overwrite;
use veni_light::sphere::{Gather, View};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/panoramas/val/kloppenheim_06.exr");
    let truth = Panorama::read(path)?;

    // 90° across, due +x, a little up: 96 × 72 pixels of linear radiance. A real photograph is `Picture::read`.
    let view = View { fov: 90_f64.to_radians(), azimuth: 0.0, elevation: 0.2, roll: 0.0 };
    let (directions, _) = view.pixels(96, 72);
    let photograph = Picture::new([96, 72], Gather::at(truth.grid(), &directions).sample(truth.pixels()))?;

    // Much of the sphere is unknown, so the prior counts, the exposure of the whole is free, and several starts are tried.
    let model = Model::pretrained();
    let (decoder, prior) = (model.decoder()?, model.prior());
    let seen = Observation::photograph(&photograph, &view, 64)?;
    println!("the photograph shows {:.0} % of the sphere", 100.0 * seen.share());
    let config = FitConfig { prior: 1e-2, free_exposure: true, ..FitConfig::thorough() };
    let target = seen.target().with_prior(&prior);
    let mut best = best_of(&decoder, &target, &random_starts(&prior, 0.0, 4, 1), &config, &mut |_, _| {})?;
    println!("loss from each start: {:.4?}", best.losses);
    // the fit saw the photograph at exposure 0
    best.latent.log_exposure += seen.log_exposure();

    let completed = Panorama::new(truth.grid(), decoder.condition(&best.latent)?.bake(truth.grid()));
    let mut options = WriteOptions::new(WriteFormat::Png(Tonemap::reference(&truth)));
    options.overwrite = Overwrite::Replace;
    truth.write("truth.png", &options)?;
    completed.write("completed.png", &options)?;
    println!("truth.png, completed.png");
    Ok(())
}
