//! Prefiltered maps: what image-based lighting looks up instead of integrating.
//!
//! A level of roughness α holds L convolved with the GGX lobe of α, seen along its own normal. On the sphere that is a product:
//! the spectrum of the map times one number per degree. Nothing is sampled, so nothing is noisy, the mean of the map is the mean
//! of every level, and lights too small for a spectrum are added in closed form.

mod axes;
mod base;
mod cube;
mod dfg;
mod disc;
mod glint;
mod law;
mod lobe;
mod unfold;

pub use axes::CubeAxes;
pub use cube::CubeMap;
pub use dfg::Dfg;
pub use law::{Law, Levels};

use super::spectrum::{MAX_DEGREE, Spectrum};
use super::{CompactLight, EnvironmentMap};
use glint::Glint;
use lobe::Lobe;

/// Power of a point light that a level may lack, as an amplitude.
const TOLERANCE: f64 = 3e-4;

/// A map, ready to be prefiltered for any number of engines.
#[derive(Clone, Debug)]
pub struct Prefilter<'a> {
    map: EnvironmentMap<'a>,
    spectrum: Spectrum,
    lights: Vec<CompactLight>,
}

impl<'a> Prefilter<'a> {
    /// Analyses a map for these chains of levels.
    pub fn new(map: EnvironmentMap<'a>, levels: &[Levels]) -> Self {
        let narrowest = levels.iter().flat_map(|l| (1..l.count()).map(|k| l.roughness(k).powi(2)));
        let degree = narrowest.fold(DIFFUSE_DEGREE, |degree, alpha| degree.max(degree_of(alpha)));
        Self { map, spectrum: Spectrum::of(map, degree), lights: Vec::new() }
    }

    /// The map is what remains without these lights: each level gets their lobes, the first level their discs.
    #[must_use]
    pub fn with_lights(mut self, lights: &[CompactLight]) -> Self {
        self.lights = lights.to_vec();
        self
    }

    /// The spectrum of the map (without the lights).
    pub fn spectrum(&self) -> &Spectrum {
        &self.spectrum
    }

    /// The level of perceptual roughness `p` as a cube of `size` texels.
    ///
    /// # Panics
    /// If `size` is 0 or `p` not in [0, 1].
    pub fn level(&self, p: f64, size: usize, axes: CubeAxes) -> CubeMap {
        assert!((0.0..=1.0).contains(&p) && size > 0, "roughness {p} in {size} texels");
        if p == 0.0 {
            let mut cube = CubeMap::of_map(self.map, size, axes);
            for light in &self.lights {
                cube.add_disc(light, axes);
            }
            return cube;
        }
        let alpha = p * p;
        let rings = self.spectrum.convolved(&lobe_gains(p, self.spectrum.degree()));
        let glints: Vec<Glint> = self.lights.iter().map(|light| Glint::new(light, alpha)).collect();
        // texels wider than the lobe, and the smallest faces, are means; others are what the lobe gathers at their centre
        let texel = 2.0 / size as f64;
        let least = if size < 8 { 32.0 / size as f64 } else { 1.0 };
        let samples = (texel / alpha).ceil().max(least).min(16.0);
        let mut cube = CubeMap::of(size, axes, samples as usize, |direction| {
            glints.iter().fold(rings.at(direction), |sum, glint| {
                let more = glint.at(direction);
                [0, 1, 2].map(|c| sum[c] + more[c])
            })
        });
        cube.scale_to(self.integral());
        cube
    }

    /// The integral of radiance over the sphere, lights included.
    pub fn integral(&self) -> [f64; 3] {
        let rest = self.spectrum.mean().map(|mean| 4.0 * std::f64::consts::PI * mean);
        self.lights.iter().fold(rest, |sum, light| [0, 1, 2].map(|c| sum[c] + f64::from(light.irradiance[c])))
    }

    /// All levels of a chain; Each is reported to `done`.
    pub fn specular(&self, levels: Levels, axes: CubeAxes, mut done: impl FnMut(usize)) -> Vec<CubeMap> {
        (0..levels.count())
            .map(|k| {
                let cube = self.level(levels.roughness(k), levels.size(k), axes);
                done(k);
                cube
            })
            .collect()
    }

    /// Irradiance over π, which a white diffuse surface facing a direction reflects: the level of roughness 1.
    ///
    /// # Panics
    /// If `size` is 0.
    pub fn diffuse(&self, size: usize, axes: CubeAxes) -> CubeMap {
        self.level(1.0, size, axes)
    }
}

/// g_l, by which the level of perceptual roughness `p` multiplies degree l of the spectrum, for l = 0 … `degree` at most: as many as
/// hold all but (3·10⁻⁴)² of the power of what the level makes of a point. g₀ = 1; at p = 1, A_l/π of the clamped cosine.
///
/// # Panics
/// Unless `p` is in (0, 1].
pub fn lobe_gains(p: f64, degree: usize) -> Vec<f64> {
    assert!(p > 0.0 && p <= 1.0, "a level of roughness {p} is not a convolution");
    Lobe::new(p * p).gains(degree, TOLERANCE)
}

/// Enough for diffuse light: |A_l| / π of a cosine falls as l^−2.5.
const DIFFUSE_DEGREE: usize = 64;

/// The degree at which the lobe's spectrum has fallen to about 6e-4.
fn degree_of(alpha: f64) -> usize {
    ((4.6 / alpha).ceil() as usize).min(MOST_DEGREES)
}

/// Beyond this only lobes narrower than two texels of usual maps have anything.
const MOST_DEGREES: usize = 511;
const _: () = assert!(MOST_DEGREES <= MAX_DEGREE);

#[cfg(test)]
mod tests;
