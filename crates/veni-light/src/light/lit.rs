//! A map split into its compact lights and the rest.

use super::environment::EnvironmentMap;
use super::extract::{Criteria, Extracted, Extraction, Level, SunChoice};
use super::sh::Sh;
use crate::luminance::luminance;
use std::f32::consts::PI;

use crate::compact::{CompactLight, Lights, RadiusSource};
use crate::field::Field;
use crate::sphere::Equirect;
use crate::vector::dot;
use crate::{Error, Result};

/// What a surface or a lobe of the sun's size needs to know of a panorama: a few compact lights, the sun first, and
/// what is left without them. Per channel the integral of the whole is that of the rest plus the lights' irradiances,
/// by construction.
///
/// ```
/// use veni_light::light::{EnvironmentMap, Light};
/// use veni_light::sphere::Equirect;
///
/// let grid = Equirect::new(256, 128);
/// let mut pixels = vec![[0.3, 0.4, 0.6]; grid.len()];
/// pixels[30 * 256 + 100] = [9e4, 8e4, 7e4];
/// let light = Light::of(EnvironmentMap::new(grid, &pixels)?);
/// assert!(light.sun().is_some_and(|sun| sun.elevation() > 0.8));
/// let up = light.irradiance([0.0, 0.0, 1.0]);
/// # assert!((up[0] - 28.1).abs() < 0.3, "{up:?}");
/// # Ok::<(), veni_light::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Light {
    pub(super) grid: Equirect,
    pub(super) residual: Vec<[f32; 3]>,
    /// The residual before any rotation, at about 256 columns.
    coarse: Level,
    pub(super) lights: Lights,
    shares: Vec<f32>,
    pub(super) harmonics: Sh<2>,
    /// How far this was rotated, radians.
    pub(super) angle: f64,
}

/// How lights are separated from the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightOptions {
    /// The most lights that are kept, the sun first; up to eight. Whether there is a sun, and what it is, does not
    /// depend on it.
    pub lights: usize,
    /// Lights of a larger angular radius, radians, stay in the map.
    pub widest: f32,
    /// A light's least share of the light on a surface that faces it.
    pub share: f32,
    /// How many times brighter a light's peak is than what surrounds it.
    pub contrast: f32,
    /// Which light is the sun.
    pub sun: SunChoice,
    /// The sun's angular radius, radians, instead of what the map shows.
    pub sun_radius: Option<f32>,
}

impl Default for LightOptions {
    fn default() -> Self {
        Self {
            lights: Self::MOST,
            widest: PI,
            share: 0.02,
            contrast: 5.0,
            sun: SunChoice::Auto,
            sun_radius: None,
        }
    }
}

impl LightOptions {
    /// The most lights that are taken out, and the number that is always looked for.
    pub const MOST: usize = Lights::MOST;

    /// The light of row-major `pixels`, which become the residual: no copy is made.
    ///
    /// # Errors
    /// [`Error`] of kind `Invalid` if the pixels are not those of an [`EnvironmentMap`], or an option makes no sense.
    pub fn of_pixels(&self, grid: Equirect, pixels: Vec<[f32; 3]>) -> Result<Light> {
        self.check()?;
        EnvironmentMap::new(grid, &pixels)?;
        Ok(self.split(grid, pixels))
    }

    /// The light of a map.
    ///
    /// # Errors
    /// [`Error`] of kind `Invalid` if an option makes no sense.
    pub fn of(&self, map: EnvironmentMap<'_>) -> Result<Light> {
        self.check()?;
        Ok(self.split(map.grid(), map.pixels().to_vec()))
    }

    fn check(&self) -> Result<()> {
        if self.lights > Self::MOST {
            return Err(Error::invalid(format!(
                "at most {} lights are taken out, not {}",
                Self::MOST,
                self.lights
            )));
        }
        if !(self.widest > 0.0 && self.widest <= PI) {
            return Err(Error::invalid(format!(
                "a light's largest angular radius is between 0° and 180°, not {}°",
                self.widest.to_degrees()
            )));
        }
        if !(self.share > 0.0 && self.share < 1.0) {
            return Err(Error::invalid(format!(
                "a light's least share is between 0 and 1, not {}",
                self.share
            )));
        }
        if !(self.contrast > 0.0 && self.contrast.is_finite()) {
            return Err(Error::invalid(format!(
                "a light's least contrast is positive, not {}",
                self.contrast
            )));
        }
        if let Some(radius) = self.sun_radius.filter(|r| !(*r > 0.0 && *r < std::f32::consts::FRAC_PI_2)) {
            return Err(Error::invalid(format!(
                "the sun's angular radius is between 0° and 90°, not {}°",
                radius.to_degrees()
            )));
        }
        if let SunChoice::Towards(d) = self.sun {
            let square = dot(d, d);
            if !(square > 0.0 && square.is_finite()) {
                return Err(Error::invalid(format!("{d:?} is not a direction towards the sun")));
            }
        }
        Ok(())
    }

    fn split(&self, grid: Equirect, pixels: Vec<[f32; 3]>) -> Light {
        let criteria = Criteria {
            most: Self::MOST,
            keep: self.lights,
            widest: self.widest,
            share: f64::from(self.share),
            contrast: f64::from(self.contrast),
        };
        let Extracted { mut lights, shares, pixels, coarse } =
            Extraction::new(grid, pixels).run(criteria, self.sun);
        if let (Some(radius), Some(sun)) = (self.sun_radius, lights.sun().copied()) {
            let sun = CompactLight { radius, radius_source: RadiusSource::Requested, ..sun };
            lights = Lights::new(Some(sun), lights.others().iter().copied());
        }
        let harmonics = Sh::of(EnvironmentMap::trusted(grid, &pixels));
        Light { grid, residual: pixels, coarse, lights, shares, harmonics, angle: 0.0 }
    }
}

impl Light {
    /// The light of a map, by the options that are the default.
    pub fn of(map: EnvironmentMap<'_>) -> Self {
        LightOptions::default().split(map.grid(), map.pixels().to_vec())
    }

    /// The light of a field, decoded at `width` × `width`/2 pixels. The lights of a code are known and are not looked for. Where the sun
    /// is not among them it may be something that the field itself draws, lobes that a glow through cloud became: what is left is then
    /// searched for one, and for as many others as there may be.
    ///
    /// # Errors
    /// [`Error`] of kind `Invalid` if the width is odd or less than 2, or the field decodes to what is not finite.
    pub fn of_field(field: &Field, width: usize) -> Result<Self> {
        if width < 2 || width % 2 == 1 {
            return Err(Error::invalid(format!("a panorama's width is even and at least 2, not {width}")));
        }
        let grid = Equirect::new(width, width / 2);
        if field.lights().is_empty() {
            return LightOptions::default().of_pixels(grid, field.bake(grid));
        }
        let known = field.lights();
        let unknown = if known.sun().is_some() { 0 } else { Lights::MOST.saturating_sub(known.len()) };
        let options = LightOptions { lights: unknown, ..LightOptions::default() };
        let rest = options.of_pixels(grid, field.without_lights().bake(grid))?;
        let mut others: Vec<_> = known.others().iter().chain(rest.lights.others()).copied().collect();
        others.sort_by(|a, b| luminance(b.irradiance).total_cmp(&luminance(a.irradiance)));
        let lights = Lights::new(known.sun().or(rest.lights.sun()).copied(), others);
        Ok(rest.with(lights))
    }

    /// A light that is split already: what is left without a sun, and the sun.
    pub fn of_parts(residual: EnvironmentMap<'_>, sun: Option<CompactLight>) -> Self {
        let options = LightOptions { lights: 0, ..LightOptions::default() };
        options.split(residual.grid(), residual.pixels().to_vec()).with(Lights::new(sun, []))
    }

    /// A rest without lights, with these.
    fn with(mut self, lights: Lights) -> Self {
        let share = |light: &CompactLight| {
            let (own, rest) = (luminance(light.irradiance), luminance(self.irradiance(light.direction)));
            if own > 0.0 { own / (own + rest) } else { 0.0 }
        };
        self.shares = lights.iter().map(share).collect();
        self.lights = lights;
        self
    }

    /// The compact lights, the sun first, then the strongest first.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// For each of the lights, its share of the light that reached a surface facing it when it was found, 0 to 1 (luminance).
    pub fn shares(&self) -> &[f32] {
        &self.shares
    }

    /// The sun, where there is one.
    pub fn sun(&self) -> Option<&CompactLight> {
        self.lights.sun()
    }

    /// The map without the lights.
    pub fn residual(&self) -> EnvironmentMap<'_> {
        EnvironmentMap::trusted(self.grid, &self.residual)
    }

    /// The pixels of the map without the lights.
    pub fn into_residual(self) -> Vec<[f32; 3]> {
        self.residual
    }

    /// The map with every light as a disc of its radius: the whole again, sharpened where the map showed a glow. Energy is that
    /// of the map at any resolution.
    pub fn sharpened(&self) -> Vec<[f32; 3]> {
        let mut pixels = self.residual.clone();
        self.lights.iter().for_each(|light| light.add_to(self.grid, &mut pixels));
        pixels
    }

    /// The map with every light but the sun as a disc of its radius: what is sampled beside the sun.
    pub fn without_sun(&self) -> Vec<[f32; 3]> {
        let mut pixels = self.residual.clone();
        self.lights.others().iter().for_each(|light| light.add_to(self.grid, &mut pixels));
        pixels
    }

    /// Mean radiance over the sphere, lights included.
    pub fn mean(&self) -> [f32; 3] {
        let root = std::f64::consts::PI.sqrt();
        let rest = self.harmonics.coefficients()[0].map(|c| c * 0.5 / root);
        let lights = self.lights.integral();
        [0, 1, 2].map(|c| (rest[c] + lights[c] / (4.0 * std::f64::consts::PI)) as f32)
    }

    /// Nine harmonics of the residual's radiance.
    pub fn residual_sh(&self) -> &Sh<2> {
        &self.harmonics
    }

    /// Nine harmonics of the whole radiance, lights included.
    pub fn sh(&self) -> Sh<2> {
        self.lights.iter().fold(self.harmonics.clone(), |sum, light| sum.plus(&Sh::of_light(light)))
    }

    /// Irradiance of a surface with this unit normal: the lights as discs, the rest summed over means of at most 256 columns.
    pub fn irradiance(&self, normal: [f32; 3]) -> [f32; 3] {
        let (sin, cos) = self.angle.sin_cos();
        let [x, y, z] = normal.map(f64::from);
        // the cells are as they were before the rotation
        let rotated = [cos * x + sin * y, cos * y - sin * x, z];
        let mut sum = [0.0; 3];
        for cell in self.coarse.kept().all() {
            let weight = cell.solid_angle * dot(cell.direction, rotated).max(0.0);
            sum = [0, 1, 2].map(|c| sum[c] + weight * f64::from(cell.radiance[c]));
        }
        for light in self.lights.iter() {
            let on = light.irradiance_on(normal);
            sum = [0, 1, 2].map(|c| sum[c] + f64::from(on[c]));
        }
        sum.map(|v| v as f32)
    }
}
