//! A model's vectors, lights and lobes, all fitted to each image: codes of more than the model's own dimension.

use serde_json::json;

use super::Codec;
use super::model::{LIGHT, code, exposed, latent, named};
use crate::Result;
use crate::canonical::Canonical;
use crate::fitting::dividing;
use veni_core::LoadedModel;
use veni_data::coarsen::{averaged, coarse_grid};
use veni_fit::{FitConfig, FitTarget, LobePlan, WIDEST_LIGHT, fit, fit_lobes};
use veni_light::latent::{Latent, Lobe};
use veni_light::light::Lights;
use veni_light::sphere::Equirect;

/// Columns of the panorama at which vectors and lobes are fitted, as `veni-cli fit` does it; lights are measured at the panorama's own.
const FITTED: usize = 128;
/// The parameters of a lobe.
const LOBE: usize = 7;

/// A code of N vectors, the lights that are measured, and K lobes.
#[derive(Clone, Debug)]
pub struct Lobed<'a> {
    subject: &'a LoadedModel,
    lobes: usize,
    /// The encoder's vectors as they are, and lobes fitted to what they leave; otherwise all are fitted.
    only_lobes: bool,
    config: FitConfig,
    pass: String,
}

impl<'a> Lobed<'a> {
    /// With `lobes` lobes; `quick`: at most 20 updates.
    pub fn new(subject: &'a LoadedModel, lobes: usize, quick: bool) -> Self {
        let prior = FitConfig::prior_for(subject.latent_vectors());
        let config = FitConfig { prior, ..FitConfig::lit() };
        let config = if quick { config.in_steps(20) } else { config };
        Self { subject, lobes, only_lobes: false, config, pass: format!("optimised, {lobes} lobes") }
    }

    /// With the lobes of the model's own codes.
    pub fn own(subject: &'a LoadedModel, quick: bool) -> Self {
        Self { pass: "optimised".to_owned(), ..Self::new(subject, subject.lobes(), quick) }
    }

    /// The vectors as the encoder says them, the model's own number of lobes fitted to what they leave; if there is an encoder.
    pub fn encoded(subject: &'a LoadedModel, quick: bool) -> Option<Self> {
        let own = Self::own(subject, quick);
        subject.veni().map(|_| Self { only_lobes: true, pass: "autoencoder".to_owned(), ..own })
    }
}

impl Codec for Lobed<'_> {
    fn system(&self) -> &str {
        self.subject.name()
    }

    fn pass(&self) -> &str {
        &self.pass
    }

    fn dimension(&self) -> usize {
        self.subject.dimension() + LIGHT * self.subject.lights() + LOBE * self.lobes
    }

    fn key(&self) -> Canonical {
        exposed(
            self.subject,
            json!({
                "model": self.subject.identity(),
                "pass": if self.only_lobes { "encoder and lobes" } else { "lobes" },
                "lobes": self.lobes,
                "widest": WIDEST_LIGHT,
                "fit": self.config,
            }),
        )
    }

    fn encode(&self, grid: Equirect, image: &[f32]) -> Result<Vec<f32>> {
        let rest = self.subject.without_lights_up_to(grid, image, WIDEST_LIGHT)?;
        let vectors = match self.subject.veni() {
            Some(_) => self.subject.encode_rest(grid, &[&rest.log_radiance])?.remove(0),
            None => vec![[0.0; 3]; self.subject.latent_vectors()],
        };
        let factor = dividing(grid, (grid.width / FITTED).max(1));
        let (fine, image) = (grid, averaged(grid, &rest.log_radiance, factor));
        let (grid, images) = (coarse_grid(grid, factor), [image.as_slice()]);
        let prior = self.subject.prior();
        let target = FitTarget::panoramas(grid, &images)?.with_prior(&prior);
        let (decoder, start) = (self.subject.fit_decoder().as_dyn(), [Latent::new(vectors)]);
        let begun = match self.only_lobes {
            true => start.to_vec(),
            false => fit(decoder, &target, &start, &self.config)?.latents,
        };
        let plan = LobePlan { count: self.lobes, only_lobes: self.only_lobes };
        let found = fit_lobes(decoder, &target, &begun, plan, &self.config, &mut |_, _| {})?;
        let mut all: Vec<f32> = vec![rest.code.lights.len() as f32];
        let mut found: Vec<Latent> = found.into_iter().map(|(latent, _)| latent).collect();
        self.subject.expose(fine, &rest, &mut found)?;
        for fitted in found {
            let z = Latent {
                lights: rest.code.lights.scaled((-fitted.log_exposure).exp()),
                log_exposure: fitted.log_exposure + rest.code.log_exposure,
                ..fitted
            };
            all.extend(code(&z));
            for Lobe { direction, amplitude, sharpness } in z.lobes {
                all.extend(direction.into_iter().chain(amplitude).chain([sharpness]));
            }
        }
        Ok(all)
    }

    fn decode(&self, grid: Equirect, values: &[f32]) -> Result<Vec<f32>> {
        Ok(self.subject.decode(grid, &[self.latent(values)])?.concat())
    }

    fn lights(&self, values: &[f32]) -> Option<Lights> {
        named(self.subject, &self.latent(values))
    }
}

impl Lobed<'_> {
    fn latent(&self, values: &[f32]) -> Latent {
        let lights = values.first().map_or(0, |count| *count as usize);
        let (plain, lobes) = values[1..].split_at(3 * self.subject.latent_vectors() + 2 + LIGHT * lights);
        let lobe = |n: &[f32; LOBE]| Lobe {
            direction: [n[0], n[1], n[2]],
            amplitude: [n[3], n[4], n[5]],
            sharpness: n[6],
        };
        let lobes = lobes.as_chunks().0.iter().map(lobe).collect();
        Latent { lobes, ..latent(self.subject, plain) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::Autoencoder;
    use veni_core::train::config::DeviceKind;
    use veni_light::light::CompactLight;
    use veni_light::model::Model;

    #[test]
    fn a_code_is_decoded_and_more_lobes_are_nearer() {
        let grid = Equirect::new(32, 16);
        // an even sky with a dark tower and a bright window
        let at = |d: &[f32; 3]| {
            let near = |u: [f32; 3]| d.iter().zip(u).map(|(a, b)| a * b).sum::<f32>();
            let tower = if near([0.0, 1.0, 0.0]) > 0.95 { -3.0 } else { 0.0 };
            let window = if near([0.6, -0.6, 0.53]) > 0.97 { 2.0 } else { 0.0 };
            [d[2] + tower, d[2] + tower + window, 1.2 * d[2] + tower]
        };
        let image: Vec<f32> = grid.directions().iter().flat_map(at).collect();
        let device = DeviceKind::Flex.device().unwrap();
        let subject = LoadedModel::new("27", Model::pretrained(), &device).unwrap();
        let error = |lobes: usize| {
            let codec = Lobed::new(&subject, lobes, true);
            let code = codec.encode(grid, &image).unwrap();
            let own = codec.dimension() - LIGHT * subject.lights();
            // the count of lights, exposure and sun beside what counts
            assert!(code.len() >= own + 3, "{} of {own}", code.len());
            let decoded = codec.decode(grid, &code).unwrap();
            let squares: f32 = decoded.iter().zip(&image).map(|(a, b)| (a - b) * (a - b)).sum();
            f64::from(squares) / image.len() as f64
        };
        let [none, some, many] = [0, 4, 12].map(error);
        assert!(some < 0.8 * none && many < some, "{none}, {some} and {many}");
        assert_ne!(Lobed::new(&subject, 4, true).key(), Lobed::new(&subject, 5, true).key());
    }

    #[test]
    fn codes_name_the_lights_that_they_were_given() {
        let grid = Equirect::new(128, 64);
        let sun = CompactLight::new([0.6, 0.0, 0.8], [9.0, 8.0, 7.0], CompactLight::SUN_RADIUS);
        let mut sky: Vec<[f32; 3]> = grid.directions().iter().map(|d| [0.5 + 0.2 * d[2]; 3]).collect();
        sun.add_to(grid, &mut sky);
        let image: Vec<f32> = sky.iter().flatten().map(|v| v.ln()).collect();
        let device = DeviceKind::Flex.device().unwrap();
        let subject = LoadedModel::new("27", Model::pretrained(), &device).unwrap();
        let encoder = Autoencoder::new(&subject).unwrap();
        let lobed = Lobed::new(&subject, 2, true);
        for codec in [&encoder as &dyn Codec, &lobed] {
            let lights = codec.lights(&codec.encode(grid, &image).unwrap()).unwrap();
            let found = lights.sun().unwrap();
            let cosine: f32 = found.direction.iter().zip(sun.direction).map(|(a, b)| a * b).sum();
            assert!(cosine > 2f32.to_radians().cos(), "{:?}", found.direction);
            assert!(found.irradiance.iter().zip(sun.irradiance).all(|(a, b)| (a / b - 1.0).abs() < 0.03));
        }
        let blind = subject.clone().with_lights(0).unwrap();
        let plain = Autoencoder::new(&blind).unwrap();
        assert!(plain.lights(&plain.encode(grid, &image).unwrap()).is_none());
    }
}
