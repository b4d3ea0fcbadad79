//! Every preset is best at what it says it is for: fits of one picture that the decoder cannot follow exactly, each
//! judged under every objective.

use veni_fit::{FitConfig, FitTarget, Objective, fit};
use veni_light::latent::Latent;
use veni_light::model::{DecoderConfig, Model, ModelConfig};
use veni_light::sphere::Equirect;

const GRID: Equirect = Equirect { width: 32, height: 16 };

/// A sky with a sun of e⁶ times its radiance over dark ground.
fn picture() -> Vec<f32> {
    let pixel = |[x, y, z]: [f32; 3]| {
        let sun = if 0.6 * x + 0.48 * y + 0.64 * z > 0.97 { 6.0 } else { 0.0 };
        let sky = if z > 0.0 { 0.6 - 0.5 * z } else { -1.5 + 0.4 * x };
        [sky + sun, sky + 0.1 + sun, sky + 0.4 * z.max(0.0) + 0.8 * sun]
    };
    GRID.directions().into_iter().flat_map(pixel).collect()
}

#[test]
fn each_preset_lowers_its_loss_and_is_best_under_its_own_objective() {
    let config = DecoderConfig { hidden: 16, layers: 2, heads: 2, ..DecoderConfig::default() };
    let config = ModelConfig { decoder: config, ..ModelConfig::decode_only(4) };
    let decoder = Model::filler(&config, 1).unwrap().decoder().unwrap();
    let picture = picture();
    let images = [picture.as_slice()];
    let target = FitTarget::panoramas(GRID, &images).unwrap();
    let none = Latent::new(vec![[0.1, 0.2, 0.3]; 4]);
    let presets = [
        ("thorough", FitConfig::thorough()),
        ("energy", FitConfig::energy()),
        ("display", FitConfig::display()),
        ("absolute", FitConfig { objective: Objective::LogAbsolute, ..FitConfig::thorough() }),
        ("reference", FitConfig::reference_helper(1e-2, 2e-3, 400)),
    ]
    .map(|(name, config)| (name, FitConfig { prior: 0.0, ..config }));
    // the loss before the first update is that of the start
    let loss = |config: &FitConfig, latent: &Latent| {
        fit(&decoder, &target, std::slice::from_ref(latent), &config.in_steps(1)).unwrap().losses[0]
    };
    let first = fit(&decoder, &target, std::slice::from_ref(&none), &presets[0].1).unwrap().latents.remove(0);
    let found = presets.map(|(_, config)| {
        // all start from one place, so that each can only be led away from it by what it looks at
        fit(&decoder, &target, std::slice::from_ref(&first), &config).unwrap().latents.remove(0)
    });
    for (k, (name, config)) in presets.iter().enumerate() {
        let losses = found.each_ref().map(|latent| loss(config, latent));
        // half or two thirds of it remain, since the decoder cannot follow the sun
        let start = loss(config, &none);
        assert!(losses[k] < 0.85 * start, "{name}: {start} to {}", losses[k]);
        // Adam goes its own way and may end at another minimum: its preset is compared with the others, not they with it
        for (j, rival) in losses.iter().enumerate().take(4).filter(|(j, _)| *j != k) {
            assert!(losses[k] < 0.9999 * rival, "{name}: {}, but {} has {rival}", losses[k], presets[j].0);
        }
    }
}
