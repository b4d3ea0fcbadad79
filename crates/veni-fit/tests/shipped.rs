//! A shipped model and a shipped panorama: the latent that the network gives on burn.

use std::path::Path;

use veni_fit::Encoder;
use veni_image::Panorama;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

/// What burn's flex device gives for `mud_road_puresky.exr` and the model of latent dimension 27.
#[allow(clippy::excessive_precision, reason = "as it was written")]
const LATENT: [[f32; 3]; 9] = [
    [0.16630743, 0.77811354, 1.1437552],
    [0.11839823, 0.20667201, -0.12533985],
    [-0.12011356, -0.14710984, -0.003205895],
    [-0.05067656, 0.053570203, 0.6123604],
    [0.015122011, -0.1625909, 0.11662656],
    [0.15343963, -0.14689393, -0.044313647],
    [0.40705308, 0.45043036, -1.9099568],
    [0.027901867, -0.039130326, 0.12498634],
    [0.4511459, 0.27690423, 0.90241694],
];
/// The mean of log luminance that is taken out before.
#[allow(clippy::excessive_precision, reason = "as it was written")]
const LOG_EXPOSURE: f32 = -1.1022649;

#[test]
fn the_latent_is_that_of_the_trained_network() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
    let model = Model::load(assets.join("../crates/veni-light/assets/veni-27.safetensors"))
        .expect("the shipped model");
    let panorama = Panorama::read(assets.join("panoramas/val/mud_road_puresky.exr")).expect("a panorama");
    let grid = Equirect::new(128, 64);
    let mut log_radiance = panorama.resample(grid).log().into_flattened();
    log_radiance.iter_mut().for_each(|v| *v -= LOG_EXPOSURE);
    let encoder = Encoder::new(&model).expect("the model has an encoder");
    let encoded = encoder.encode(grid, &[&log_radiance]).expect("a panorama").remove(0);
    let norm = |v: &mut dyn Iterator<Item = f32>| v.map(|v| v * v).sum::<f32>().sqrt();
    let pairs = encoded.vectors.as_flattened().iter().zip(LATENT.as_flattened());
    let error = norm(&mut pairs.map(|(a, b)| a - b)) / norm(&mut LATENT.as_flattened().iter().copied());
    assert!(error < 1e-5, "{error}");
    assert_eq!(encoded.log_variances.map(|l| l.len()), Some(9));
}
