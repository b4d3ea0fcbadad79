//! Random skies on request: where the sun is, how overcast it is, how warm the light. MODEL (75), (76).
//!
//! ```
//! # #[cfg(feature = "pretrained")] {
//! use veni_light::model::Model;
//! use veni_light::random::Stream;
//! use veni_light::skies::SkyRequest;
//!
//! let (model, mut request) = (Model::pretrained(), SkyRequest::default());
//! request.sun.elevation = Some(8f64.to_radians());
//! request.overcast = Some(0.3);
//! let latent = request.draw(&model.decoder()?, &model.prior(), &mut Stream::from_seed(7))?;
//! let sun = latent.lights.sun().expect("one was asked for");
//! assert!((sun.elevation().to_degrees() - 8.0).abs() < 0.01);
//! # }
//! # Ok::<(), veni_light::Error>(())
//! ```

mod search;
mod temperature;

pub use temperature::{chromaticity, temperature};

use crate::field::Decoder;
use crate::latent::{Latent, Prior, SunRequest};
use crate::light::{Light, luminance};
use crate::random::Stream;
use crate::{Error, Result};

/// What a level surface faces.
const UP: [f32; 3] = [0.0, 0.0, 1.0];
/// From this share of light without shadow on there is no sun.
const SUNLESS: f64 = 0.98;
/// Least share of light without shadow under a sun.
const CLEAREST: f64 = 0.02;
/// Colour temperatures that can be asked for, kelvin.
const TEMPERATURES: [f64; 2] = [2000.0, 20_000.0];

/// What is asked of a random sky; what is None is left to chance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkyRequest {
    /// The sun.
    pub sun: SunRequest,
    /// Share of the luminance on a level surface that does not come from the sun itself, in 0.02 … 1: the diffuse fraction of
    /// meteorology. About 0.15 under a clear sky with the sun high; 1 (from 0.98 on) is a sky without sun.
    pub overcast: Option<f64>,
    /// Correlated colour temperature of all light on a level surface, kelvin, in 2000 … 20000.
    pub temperature: Option<f64>,
}

/// What of a light can be asked for, measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyMeasures {
    /// Azimuth and elevation of the sun, radians, where there is one.
    pub sun: Option<[f64; 2]>,
    /// See [`SkyRequest::overcast`].
    pub overcast: f64,
    /// See [`SkyRequest::temperature`]; None of what is not near the colours of black bodies.
    pub temperature: Option<f64>,
}

impl SkyMeasures {
    /// Of any light: of a baked panorama as of a photograph.
    pub fn of(light: &Light) -> Self {
        let total = light.irradiance(UP);
        let sun = light.sun().map_or([0.0; 3], |sun| sun.irradiance_on(UP));
        let [all, direct] = [total, sun].map(|e| f64::from(luminance(e)));
        Self {
            sun: light.sun().map(|sun| [sun.azimuth(), sun.elevation()].map(f64::from)),
            overcast: if all > 0.0 { 1.0 - direct / all } else { 1.0 },
            temperature: temperature(total.map(f64::from)),
        }
    }
}

impl SkyRequest {
    /// Whether anything is asked.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// A random code that is as asked. Of one generator state it is the same place as [`Latent::sample`]'s, as far as the prior
    /// allows: vectors and sun are moved by the least step, in standard deviations, that fulfils the request. The sun is where it
    /// is asked to be, and overcast what is asked, exactly; the temperature is met where the search finds it ([`SkyMeasures`] says
    /// what came).
    ///
    /// # Errors
    /// [`Error::Unsupported`] if a sun is asked of a prior that knows of none ([`Prior::sun`]); [`Error::Invalid`] if the request is
    /// out of range or contradicts itself, or the decoder is not the prior's.
    pub fn draw(&self, decoder: &Decoder, prior: &Prior, rng: &mut Stream) -> Result<Latent> {
        let request = self.checked()?;
        if prior.latent_vectors() != decoder.latent_vectors() {
            return Err(Error::invalid(format!(
                "a prior of {} vectors and a decoder of {}",
                prior.latent_vectors(),
                decoder.latent_vectors()
            )));
        }
        let asks_of_sun = request.sun != SunRequest::default() || request.overcast.is_some();
        if asks_of_sun && prior.sun().is_none() {
            return Err(Error::unsupported("the model knows nothing of suns: its prior was fitted without"));
        }
        search::search(&request, decoder, prior, rng)
    }

    /// Bounds kept, and what the parts imply for each other.
    fn checked(&self) -> Result<Self> {
        let mut request = *self;
        let SunRequest { azimuth, elevation, .. } = self.sun;
        if azimuth.is_some_and(|angle| !angle.is_finite()) {
            return Err(Error::invalid("the azimuth of the sun is not finite"));
        }
        if let Some(elevation) = elevation
            && !(elevation > 0.0 && elevation <= std::f64::consts::FRAC_PI_2)
        {
            let degrees = elevation.to_degrees();
            return Err(Error::invalid(format!(
                "the sun's elevation is above 0° and up to 90°, not {degrees:.2}°"
            )));
        }
        if self.sun.present == Some(false) && self.sun.presence() == Some(true) {
            return Err(Error::invalid("a direction of the sun, and no sun"));
        }
        if let Some(overcast) = self.overcast {
            if !(CLEAREST..=1.0).contains(&overcast) {
                return Err(Error::invalid(format!(
                    "overcast is between {CLEAREST} (clear) and 1 (no sun), not {overcast}"
                )));
            }
            let sunless = overcast >= SUNLESS;
            if self.sun.presence() == Some(sunless) {
                let what = if sunless { "a sun" } else { "no sun" };
                return Err(Error::invalid(format!("overcast {overcast} and {what} exclude each other")));
            }
            request.sun.present = Some(!sunless);
            request.overcast = (!sunless).then_some(overcast);
        }
        let [least, most] = TEMPERATURES;
        if let Some(kelvin) = self.temperature.filter(|t| !(least..=most).contains(t)) {
            return Err(Error::invalid(format!(
                "a colour temperature is between {least} and {most} K, not {kelvin}"
            )));
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests;
