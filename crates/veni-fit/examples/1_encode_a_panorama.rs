//! A panorama as a code of latent dimension 27, by the encoder, and the panorama that the code stands for.
//!
//! ```sh
//! cargo run --release -p veni-fit --example 1_encode_a_panorama -- street.hdr    # without a name: one of assets/panoramas
//! ```
//!
//! Writes `latent.json`, which `veni-cli bake` takes too, `original.png` and `decoded.png`.

#![allow(clippy::print_stdout, reason = "an example")]

use std::path::{Path, PathBuf};

use veni_fit::Encoder;
use veni_image::tonemap::Tonemap;
use veni_image::{Panorama, WriteFormat, WriteOptions};
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/panoramas/val/chinese_garden.exr");
    let path = std::env::args().nth(1).map_or(own, PathBuf::from);
    let mut panorama = Panorama::read(&path)?.resample(Equirect::new(128, 64));
    panorama.sanitise()?;

    // The encoder takes log radiance at exposure 0; what was taken off belongs to the code.
    let log_exposure = panorama.mean_log_luminance();
    let log: Vec<f32> = panorama.log().as_flattened().iter().map(|v| v - log_exposure).collect();
    let model = Model::pretrained();
    let encoded = &Encoder::new(&model)?.encode(panorama.grid(), &[&log])?[0];
    let latent = Latent { log_exposure, model: Some(model.hash()), ..Latent::new(encoded.vectors.clone()) };
    latent.save("latent.json", Overwrite::Replace)?;

    let decoded = Panorama::new(panorama.grid(), model.decoder()?.condition(&latent)?.bake(panorama.grid()));
    // one tone curve for both, so that they can be compared
    let mut options = WriteOptions::new(WriteFormat::Png(Tonemap::reference(&panorama)));
    options.overwrite = Overwrite::Replace;
    panorama.write("original.png", &options)?;
    decoded.write("decoded.png", &options)?;
    println!("{}: {:?}, exposure {log_exposure:.2}", path.display(), latent.vectors);
    println!("latent.json, original.png, decoded.png");
    Ok(())
}
