//! Both ways to run a decoder agree, and what each objective refuses.

use burn::tensor::Device;
use veni_light::model::{DecoderConfig, Model, ModelConfig, ModelInfo};
use veni_light::random::{Purpose, stream};
use veni_light::sphere::Equirect;

use super::shade::{
    Camera, Colour, DistantLights, Material, REFERENCE_FIELD_OF_VIEW, RenderedImage, RenderingLoss,
    ShadingForm, Surface, Transfer,
};
use super::*;
use crate::train::loss::LossConfig;
use crate::vae::{Decoder, veni::model_of, weights};

fn decoder() -> Decoder {
    let config = DecoderConfig { hidden: 16, layers: 2, heads: 2, ..DecoderConfig::default() };
    Decoder::new(&config, 3, &mut stream(1, Purpose::Weights, 0, 0), &Device::flex())
}

fn latent(seed: u64) -> Latent {
    let mut rng = stream(seed, Purpose::Fit, 0, 0);
    Latent::new((0..3).map(|_| [0; 3].map(|_| rng.normal() as f32)).collect())
}

fn image(decoder: &Decoder, grid: Equirect, seed: u64) -> Vec<f32> {
    crate::vae::veni::decode(decoder, grid, &[latent(seed).vectors]).remove(0)
}

/// The same decoder as a model, whose folded form takes the fast way.
fn model(decoder: &Decoder) -> Model {
    let config = DecoderConfig { hidden: 16, layers: 2, heads: 2, ..DecoderConfig::default() };
    let config = ModelConfig { decoder: config, ..ModelConfig::decode_only(3) };
    model_of(weights::read(decoder, "decoder."), &config, ModelInfo::default()).unwrap()
}

fn objectives() -> [Objective; 7] {
    [
        Objective::LogError,
        Objective::LogAbsolute,
        Objective::Display { log: 0.01 },
        Objective::Energy { weight: 0.4 },
        Objective::ReferenceLogError,
        Objective::CosineScaleInvariant,
        Objective::Terms(LossConfig { mage_scales: 1, ..LossConfig::default() }),
    ]
}

#[test]
fn the_fast_way_and_the_graph_go_the_same_way() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let folded = model(&decoder).decoder().unwrap();
    let images = [1, 2].map(|seed| image(&decoder, grid, seed));
    let views: Vec<_> = images.iter().map(Vec::as_slice).collect();
    let target = FitTarget::panoramas(grid, &views).unwrap();
    let start = [3, 4].map(latent);
    for objective in objectives() {
        let config =
            FitConfig { steps: 5, objective, free_exposure: true, prior: 0.01, ..FitConfig::light() };
        let fast = fit(&folded, &target, &start, &config).unwrap();
        let graph = fit(&decoder, &target, &start, &config).unwrap();
        let close =
            |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4 * (1.0 + b.abs()));
        assert!(close(&fast.losses, &graph.losses), "{objective:?}: {:?} {:?}", fast.losses, graph.losses);
        assert!(close(&fast.last, &graph.last), "{objective:?}: {:?} {:?}", fast.last, graph.last);
        for (a, b) in fast.latents.iter().zip(&graph.latents) {
            let pairs = a.vectors.as_flattened().iter().zip(b.vectors.as_flattened());
            let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(apart < 2e-3, "{objective:?}: {apart}");
            assert!((a.log_exposure - b.log_exposure).abs() < 2e-3, "{objective:?}");
        }
        assert!(fast.losses[4] < fast.losses[0], "{objective:?}");
    }
}

#[test]
fn losses_over_whole_images_take_no_masks() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let image = image(&decoder, grid, 1);
    let (images, mask) = ([image.as_slice()], vec![1.0; grid.len()]);
    let masked = FitTarget::panoramas(grid, &images).unwrap().masked(&[&mask]).unwrap();
    for objective in &objectives()[5..] {
        let config = FitConfig { objective: *objective, ..FitConfig::light() };
        let message = fit(&decoder, &masked, &[latent(1)], &config).unwrap_err().to_string();
        assert!(message.contains("takes no masks"), "{message}");
    }
}

#[test]
fn where_it_does_not_apply_it_is_refused_and_auto_takes_adam() {
    let (decoder, grid) = (decoder(), Equirect::new(16, 8));
    let folded = model(&decoder).decoder().unwrap();
    let image = image(&decoder, grid, 1);
    let views = [image.as_slice()];
    let target = FitTarget::panoramas(grid, &views).unwrap();
    let start = [latent(2)];
    let config = FitConfig { steps: 5, method: Method::LevenbergMarquardt, ..FitConfig::thorough() };
    let message = fit(&decoder, &target, &start, &config).unwrap_err().to_string();
    assert!(message.contains("levenberg-marquardt") && message.contains("folded"), "{message}");
    let rays = FitConfig { objective: Objective::CosineScaleInvariant, ..config };
    let message = fit(&folded, &target, &start, &rays).unwrap_err().to_string();
    assert!(message.contains("whole images") && message.contains("adam"), "{message}");
    for (decoder, config) in [(FitDecoder::from(&decoder), config), (FitDecoder::from(&folded), rays)] {
        let run = |method| fit(decoder, &target, &start, &FitConfig { method, ..config }).unwrap();
        assert_eq!(run(Method::Auto), run(Method::Adam));
    }
    let run = |method| fit(&folded, &target, &start, &FitConfig { method, ..config }).unwrap();
    assert_eq!(run(Method::Auto), run(Method::LevenbergMarquardt));
    assert_ne!(run(Method::Auto), run(Method::Adam));
}

/// A glossy ball under the light of a latent.
fn ball(seed: u64, exposure: f32) -> RenderedImage {
    let place = ([0.0; 3], 1.0);
    let camera = Camera::framing(place, [0.0; 2], REFERENCE_FIELD_OF_VIEW, [20, 20], 0.05).unwrap();
    let surface = Surface::sphere(&camera, place, 20, 20).unwrap();
    let material = Material::blinn_phong(Colour::Uniform([0.8; 3]), 0.5, 40.0);
    let lights = DistantLights::equirect(Equirect::new(16, 8));
    let transfer = Transfer::new(&surface, &material, lights, ShadingForm::Physical).unwrap();
    let light = Latent { log_exposure: exposure, ..latent(seed) };
    let field = model(&decoder()).decoder().unwrap().condition(&light).unwrap();
    let photograph = transfer.render(&field.bake(Equirect::new(16, 8)));
    RenderedImage::new(transfer, &photograph, RenderingLoss::default()).unwrap()
}

#[test]
fn the_light_on_a_surface_is_the_same_both_ways() {
    let graph = decoder();
    let fast = model(&graph).decoder().unwrap();
    let images = [ball(1, 0.0), ball(2, 0.3)];
    let start = [3, 4].map(latent);
    let config = FitConfig { free_exposure: true, steps: 4, ..FitConfig::light() };
    let a = fit_rendered(&fast, &images, None, &start, &config, &mut |_, _| {}).unwrap();
    let b = fit_rendered(&graph, &images, None, &start, &config, &mut |_, _| {}).unwrap();
    for (a, b) in a.losses.iter().chain(&a.last).zip(b.losses.iter().chain(&b.last)) {
        assert!((a - b).abs() < 1e-4 * (1e-3 + b), "{a} {b}");
    }
    let close = |a: f32, b: f32| (a - b).abs() < 2e-3;
    assert!(a.latents.iter().zip(&b.latents).all(|(a, b)| close(a.log_exposure, b.log_exposure)));
}
