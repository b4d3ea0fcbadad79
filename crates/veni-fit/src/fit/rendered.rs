//! The light on a photographed surface: the latent under which its rendering is the photograph.

use super::network::{ImageLoss, Network};
use super::{FitConfig, FitResult, LatentDecoder, check_prior, check_starts, optimise};
use crate::shade::RenderedImage;
use crate::{Error, Result};
use veni_light::latent::{Latent, Prior};

/// Optimises one latent per image from `start`. Each image's loss is its own
/// ([`RenderingLoss`](crate::shade::RenderingLoss)): [`FitConfig::objective`] is not looked at. All must have the same
/// lights, those the decoder is asked for. A latent's log exposure is the number that the image's
/// [`ExposureForm`](crate::shade::ExposureForm) takes. `observer` gets the number of updates made and the mean loss.
///
/// # Errors
/// [`Error::Invalid`] if the numbers of images and starts or their sizes disagree, if there are none, if lights
/// differ, or if the loss is no longer finite.
pub fn fit_rendered(
    decoder: &dyn LatentDecoder,
    images: &[RenderedImage],
    prior: Option<&Prior>,
    start: &[Latent],
    config: &FitConfig,
    observer: &mut dyn FnMut(u64, f64),
) -> Result<FitResult> {
    config.check()?;
    let n = decoder.latent_vectors();
    let Some(first) = images.first() else { return Err(Error::invalid("0 images to fit")) };
    check_starts(start, images.len(), n)?;
    check_prior(prior, n)?;
    let lights = first.transfer().lights();
    if images.iter().any(|image| image.transfer().lights() != lights) {
        return Err(Error::invalid("images that are fitted together must be lit by the same lights"));
    }
    let network = Network::new(decoder, lights.directions().to_vec());
    optimise(&network, &ImageLoss::Rendered(images), prior, start, config, observer)
}

/// The log exposure at which the rendering of light `log_radiance` is as bright, on average, as the picture `target` (both in
/// the order of the image): where a fit of the light may start. 0 if either is black.
///
/// # Panics
/// If there is not one log radiance per light.
pub fn matching_exposure(image: &RenderedImage, target: &[[f32; 3]], log_radiance: &[[f32; 3]]) -> f32 {
    let rendering =
        image.transfer().render(&log_radiance.iter().map(|p| p.map(f32::exp)).collect::<Vec<_>>());
    let (mut seen, mut rendered) = (0.0f64, 0.0f64);
    for (target, found) in target.iter().zip(&rendering) {
        if target.iter().all(|v| v.is_finite()) && found.iter().any(|v| *v > 0.0) {
            seen += target.iter().map(|v| f64::from(*v)).sum::<f64>();
            rendered += found.iter().map(|v| f64::from(*v)).sum::<f64>();
        }
    }
    if seen > 0.0 && rendered > 0.0 { (seen / rendered).ln() as f32 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{decoder, latent};
    use super::*;
    use crate::shade::{
        Camera, Colour, DistantLights, Material, REFERENCE_FIELD_OF_VIEW, RenderingLoss, ShadingForm,
        Surface, Transfer,
    };
    use veni_light::sphere::Equirect;

    fn lit(seed: u64, exposure: f32) -> Latent {
        Latent { log_exposure: exposure, ..latent(seed) }
    }

    /// A glossy ball under the light of a latent.
    fn ball(light: &Latent) -> RenderedImage {
        let place = ([0.0; 3], 1.0);
        let camera = Camera::framing(place, [0.0; 2], REFERENCE_FIELD_OF_VIEW, [20, 20], 0.05).unwrap();
        let surface = Surface::sphere(&camera, place, 20, 20).unwrap();
        let material = Material::blinn_phong(Colour::Uniform([0.8; 3]), 0.5, 40.0);
        let lights = DistantLights::equirect(Equirect::new(16, 8));
        let transfer = Transfer::new(&surface, &material, lights, ShadingForm::Physical).unwrap();
        let field = decoder().condition(light).unwrap();
        let photograph = transfer.render(&field.bake(Equirect::new(16, 8)));
        RenderedImage::new(transfer, &photograph, RenderingLoss::default()).unwrap()
    }

    #[test]
    fn the_true_light_is_a_perfect_fit_and_a_near_one_is_drawn_to_it() {
        let decoder = decoder();
        // a fixed light, not a drawn one: from such a start many lights end in another minimum
        let vectors = vec![
            [0.310_540_83, -0.051_211_808, 0.701_957_1],
            [-0.286_496_3, 1.988_833_8, 0.801_544_85],
            [-1.028_519_6, -0.076_070_23, -0.646_246_43],
        ];
        let truth = Latent { log_exposure: 0.4, ..Latent::new(vectors) };
        let image = [ball(&truth)];
        let config = FitConfig { prior: 0.0, free_exposure: true, ..FitConfig::light() };
        let none = FitConfig { steps: 0, ..config };
        let exact = fit_rendered(&decoder, &image, None, std::slice::from_ref(&truth), &none, &mut |_, _| {})
            .unwrap();
        assert!(exact.last[0] < 1e-9, "{}", exact.last[0]);
        let mut near = truth;
        near.vectors.as_flattened_mut().iter_mut().for_each(|v| *v += 0.05);
        near.log_exposure = 0.0;
        let mut calls = 0;
        let found = fit_rendered(&decoder, &image, None, &[near], &config, &mut |_, _| calls += 1).unwrap();
        assert!(found.last[0] < 1e-6 * found.losses[0], "{} of {}", found.last[0], found.losses[0]);
        assert!((found.latents[0].log_exposure - 0.4).abs() < 1e-2 && calls == 400);
    }

    #[test]
    fn brightness_is_matched_by_the_exposure() {
        let image = ball(&lit(1, 0.4));
        let field = decoder().condition(&latent(1)).unwrap();
        let mut light = vec![[0.0; 3]; 128];
        field.log_radiance_batch(&Equirect::new(16, 8).directions(), &mut light);
        let target = image.render(&light, 0.7);
        assert!((matching_exposure(&image, &target, &light) - 0.7).abs() < 1e-4);
        assert_eq!(matching_exposure(&image, &vec![[0.0; 3]; 400], &light), 0.0);
    }

    #[test]
    fn images_of_other_lights_and_missing_starts_are_refused() {
        let decoder = decoder();
        let config = FitConfig::light();
        let refused = |images: &[RenderedImage], start: &[Latent]| {
            fit_rendered(&decoder, images, None, start, &config, &mut |_, _| {}).unwrap_err().to_string()
        };
        assert!(refused(&[], &[]).contains("0 images"));
        assert!(refused(&[ball(&lit(1, 0.0))], &[]).contains("0 latents"));
    }
}
