//! Fits of what shows part of the sphere, a photograph or a panorama with a mask: how `veni-cli fit` and the protocols of
//! evaluation make them.
//!
//! Compact lights in sight are taken out first ([`seen_lights`]). What is not seen has nothing but the prior to go by: its weight is larger, the exposure is found with the latent, and of several
//! starts the best is kept. A sun out of sight is the one that the prior thinks most likely given the vectors, MODEL (74).

use veni_image::{DARK_SHARE, Picture};
use veni_light::latent::{Latent, Prior};
use veni_light::light::{CompactLight, LightOptions, Lights, luminance};
use veni_light::sphere::Equirect;

use crate::observation::black;
use crate::{Error, FitConfig, Observation, Plateau, Result, random_starts};

/// Starts: enough to see where they disagree.
pub const STARTS: usize = 4;
/// Weight of the prior where all but this part of the sphere is unknown.
const PRIOR: f64 = 0.01;
/// Where part of a panorama is fitted.
pub const GRID: Equirect = Equirect { width: 64, height: 32 };
/// Longest side at which a photograph is fitted, in pixels.
pub const LONGEST: usize = 96;
/// A plateau: N steps in which the loss falls by less than this fraction.
pub const PLATEAU: Plateau = Plateau { patience: 50, improvement: 1e-3 };

/// Weight of the prior where `share` of the sphere is known: the less, the fewer independent errors speak against it. The loss is
/// their mean, so that the weight falls with their number: 0.02 for half, 0.14 for a photograph of 65°.
pub fn prior_weight(share: f32) -> f64 {
    PRIOR / f64::from(share).clamp(PRIOR, 1.0)
}

/// How the latent is found where `share` of the sphere is known.
pub fn config(share: f32) -> FitConfig {
    FitConfig {
        prior: prior_weight(share),
        free_exposure: true,
        plateau: Some(PLATEAU),
        ..FitConfig::thorough()
    }
}

/// Latent 0 and [`STARTS`] − 1 draws of the prior.
pub fn starts(prior: &Prior, seed: u64) -> Vec<Latent> {
    let zero = Latent::new(vec![[0.0; 3]; prior.latent_vectors()]);
    std::iter::once(zero).chain(random_starts(prior, 0.0, STARTS - 1, seed)).collect()
}

/// The sun that is likely where `observation` sees nothing, at the exposure of the vectors, and how likely it is: more likely than
/// not. `None` too where the prior knows nothing of suns.
pub fn likely_sun(prior: &Prior, latent: &Latent, observation: &Observation) -> Option<(f64, CompactLight)> {
    let (chance, sun) = prior.likely_sun(&latent.vectors)?;
    (chance > 0.5 && !observation.sees(sun.direction)).then_some((chance, sun))
}

/// Up to `most` compact lights of what is known of a panorama of radiance, none of an angular radius above `widest` (radians), and
/// the panorama without them. A field that was trained
/// without suns should not see them, and a sun in sight leaves none to be guessed. Where all that is left is black, it is 10⁻⁴ of the
/// mean radiance of the picture with its lights instead: dark beside them, and something to be fitted.
///
/// # Errors
/// [`Error::Invalid`] if the picture is not twice as wide as high, no pixel is known to have positive radiance, or `most` is more
/// than [`LightOptions::MOST`].
pub fn seen_lights(picture: &Picture, most: usize, widest: f32) -> Result<(Picture, Lights)> {
    let [width, height] = picture.size();
    let grid = Equirect::new(width, height);
    if width != 2 * height {
        return Err(Error::invalid(format!(
            "{width} × {height} is not a panorama, and lights are measured in panoramas alone"
        )));
    }
    let known = |p: usize| {
        let finite = picture.pixels()[p].iter().all(|v| v.is_finite());
        if finite { picture.known().map_or(1.0, |known| known[p].clamp(0.0, 1.0).max(0.0)) } else { 0.0 }
    };
    let known: Vec<f32> = (0..grid.len()).map(known).collect();
    // of a resampled panorama values may be a little below 0
    let mut pixels: Vec<_> = picture.pixels().iter().map(|p| p.map(|v| v.max(0.0))).collect();
    let weights: Vec<f64> =
        known.iter().enumerate().map(|(p, k)| grid.solid_angle(p / width) * f64::from(*k)).collect();
    let mean = black::mean(&pixels, &weights);
    let partial = known.iter().any(|k| *k < 1.0);
    if partial {
        // what is not known is even and as bright as the rest in the mean: nothing stands out of it
        let lit = pixels.iter().zip(&weights).filter(|(p, weight)| **weight > 0.0 && luminance(**p) > 0.0);
        let (mut sum, mut whole) = (0.0, 0.0);
        for (pixel, weight) in lit {
            (sum, whole) = (sum + weight * f64::from(luminance(*pixel)).ln(), whole + weight);
        }
        if whole == 0.0 {
            return Err(Error::invalid("no known pixel of the picture has positive radiance"));
        }
        let even = (sum / whole).exp() as f32;
        for (pixel, k) in pixels.iter_mut().zip(&known).filter(|(_, k)| **k < 1.0) {
            *pixel = pixel.map(|v| if *k > 0.0 { k * v + (1.0 - k) * even } else { even });
        }
    }
    let light = LightOptions { lights: most, widest, ..LightOptions::default() }.of_pixels(grid, pixels)?;
    let lights = light.lights().clone();
    let mut rest = light.into_residual();
    let is_lit = |(pixel, known): (&[f32; 3], &f32)| *known > 0.0 && pixel.iter().any(|v| *v > 0.0);
    if !lights.is_empty() && !rest.iter().zip(&known).any(is_lit) {
        rest.fill([(DARK_SHARE * mean) as f32; 3]);
    }
    let rest = Picture::new([width, height], rest)?;
    Ok((if partial { rest.masked(&known)? } else { rest }, lights))
}

#[cfg(test)]
mod tests;
