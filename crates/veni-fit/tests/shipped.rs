//! A shipped model and a shipped panorama: the latent that the network gives on burn.

use std::path::Path;

use veni_fit::Encoder;
use veni_image::Panorama;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

/// What burn's flex device gives for `mud_road_puresky.exr`, which shows no sun, and the model of latent dimension 27: the code that
/// `veni-cli evaluate reconstruction` keeps.
#[allow(clippy::excessive_precision, reason = "as it was written")]
const LATENT: [[f32; 3]; 9] = [
    [0.021185363, 0.020357879, 1.9161845],
    [0.046317782, 0.033416845, 0.021908036],
    [-0.011785301, 0.05724337, -0.60098714],
    [-0.05154031, 0.07682677, -1.6683748],
    [-0.023922794, -0.036541037, -0.09623998],
    [-0.47664657, -0.36404583, -0.41190988],
    [-0.09746486, -0.66251695, 0.50713754],
    [0.37619042, 0.2186589, -1.4328219],
    [0.10460705, 0.24946453, -0.34321505],
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
