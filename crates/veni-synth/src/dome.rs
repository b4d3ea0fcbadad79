//! The clear sky around one source of light, as a table over elevation and azimuth from it. MODEL (66).

use glam::Vec3;

use super::atmosphere::Atmosphere;
use super::spectrum::{BANDS, Spectrum, to_rgb};

const ELEVATIONS: usize = 44;
const AZIMUTHS: usize = 25;
const STEPS: usize = 30;
/// Height of the viewer above the sea, km.
const VIEWER: f64 = 0.1;
/// Asymmetry of the aerosol's phase function.
const ASYMMETRY: f32 = 0.76;

/// The sky that a distant source lights.
#[derive(Clone, Debug)]
pub(super) struct Dome {
    source: Vec3,
    bearing: f32,
    /// Light from molecules and from more than one scattering; light from aerosol before its phase function.
    table: Vec<[Vec3; 2]>,
}

impl Dome {
    /// The sky lit from the unit direction `source` with this spectral irradiance above the atmosphere.
    pub(super) fn new(air: &Atmosphere, source: Vec3, irradiance: &Spectrum) -> Self {
        let sun = f64::from(source.z);
        let across = (1.0 - sun * sun).max(0.0).sqrt();
        let mut table = Vec::with_capacity(ELEVATIONS * AZIMUTHS);
        for j in 0..ELEVATIONS {
            let mu = f64::from(elevation(j as f32)).sin();
            for i in 0..AZIMUTHS {
                let azimuth = std::f64::consts::PI * i as f64 / (AZIMUTHS - 1) as f64;
                let cosine = mu * sun + (1.0 - mu * mu).sqrt() * across * azimuth.cos();
                let phase = rayleigh_phase(cosine as f32);
                let (mut rest, mut aerosol) = ([0.0; BANDS], [0.0; BANDS]);
                air.walk([VIEWER, mu, sun, cosine], STEPS, |step| {
                    let (rayleigh, mie) = air.scattering(step.density);
                    let lit = air.to_sun(step.height, step.sun);
                    let again = air.multiple(step.height, step.sun);
                    for k in 0..BANDS {
                        // an exponential fall within the step, integrated
                        let depth = step.length * (rayleigh[k] + mie[k]);
                        let within = if depth > 1e-4 { (1.0 - (-depth).exp()) / depth } else { 1.0 };
                        let weight = step.transmittance[k] * step.length * within * irradiance[k];
                        rest[k] +=
                            weight * (rayleigh[k] * phase * lit[k] + (rayleigh[k] + mie[k]) * again[k]);
                        aerosol[k] += weight * mie[k] * lit[k];
                    }
                });
                table.push([to_rgb(&rest), to_rgb(&aerosol)]);
            }
        }
        Self { source, bearing: source.y.atan2(source.x), table }
    }

    /// Radiance of a direction; below the horizon that of the horizon.
    pub(super) fn radiance(&self, direction: Vec3) -> Vec3 {
        let e = direction.z.clamp(0.0, 1.0).asin();
        let v = (e / std::f32::consts::FRAC_PI_2).sqrt() * (ELEVATIONS - 1) as f32;
        let turn = (direction.y.atan2(direction.x) - self.bearing).rem_euclid(std::f32::consts::TAU);
        let turn = turn.min(std::f32::consts::TAU - turn);
        let u = turn / std::f32::consts::PI * (AZIMUTHS - 1) as f32;
        let (i, j) = ((u as usize).min(AZIMUTHS - 2), (v as usize).min(ELEVATIONS - 2));
        let (s, t) = (u - i as f32, v - j as f32);
        let (a, b) = (&self.table[j * AZIMUTHS + i..], &self.table[(j + 1) * AZIMUTHS + i..]);
        let [rest, aerosol] = [0, 1].map(|k| a[0][k].lerp(a[1][k], s).lerp(b[0][k].lerp(b[1][k], s), t));
        rest + aerosol * aerosol_phase(direction.dot(self.source))
    }
}

/// Rows are denser near the horizon, where the sky changes fastest.
fn elevation(row: f32) -> f32 {
    let t = row / (ELEVATIONS - 1) as f32;
    std::f32::consts::FRAC_PI_2 * t * t
}

/// Rayleigh's phase function, per steradian.
fn rayleigh_phase(cosine: f32) -> f32 {
    3.0 / (16.0 * std::f32::consts::PI) * (1.0 + cosine * cosine)
}

/// Cornette & Shanks (1992), per steradian.
fn aerosol_phase(cosine: f32) -> f32 {
    const G: f32 = ASYMMETRY;
    let shape = (1.0 + G * G - 2.0 * G * cosine).max(1e-4).powf(-1.5);
    3.0 / (8.0 * std::f32::consts::PI) * (1.0 - G * G) / (2.0 + G * G) * (1.0 + cosine * cosine) * shape
}

/// Henyey & Greenstein (1941), per steradian.
pub(super) fn henyey_greenstein(g: f32, cosine: f32) -> f32 {
    (1.0 - g * g) / (4.0 * std::f32::consts::PI) * (1.0 + g * g - 2.0 * g * cosine).max(1e-4).powf(-1.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{SUN, luminance};

    #[test]
    fn a_clear_sky_is_blue_brighter_near_sun_and_horizon_and_dims_at_dusk() {
        let air = Atmosphere::new(2.5, 300.0, 0.2);
        let at = |e: f32| Vec3::new(e.to_radians().cos(), 0.0, e.to_radians().sin());
        let noon = Dome::new(&air, at(50.0), &SUN);
        let zenith = noon.radiance(Vec3::Z);
        assert!(zenith.z > 1.8 * zenith.x, "{zenith}");
        assert!((1.0..8.0).contains(&luminance(zenith)), "{zenith} kcd/m²");
        let away = |e: f32| Vec3::new(0.0, 1.0, 0.0) * e.to_radians().cos() + Vec3::Z * e.to_radians().sin();
        assert!(luminance(noon.radiance(away(2.0))) > 1.5 * luminance(zenith));
        assert!(luminance(noon.radiance(at(45.0))) > 3.0 * luminance(noon.radiance(away(50.0))));
        // continuous in azimuth across the far side
        let seam = [-1e-3f32, 1e-3].map(|y| noon.radiance(Vec3::new(-0.9, y, 0.43).normalize()));
        assert!((seam[0] - seam[1]).abs().max_element() < 1e-2 * seam[0].max_element());
        let mut last = f32::INFINITY;
        for elevation in [30.0, 5.0, 0.0, -3.0, -6.0, -10.0] {
            let dome = Dome::new(&air, at(elevation), &SUN);
            let y = luminance(dome.radiance(Vec3::Z));
            assert!(y < last && y > 0.0, "{elevation}°: {y} after {last}");
            last = y;
        }

        // orange towards the sun at sunset and after, blue overhead
        for elevation in [0.5, -1.0, -3.0] {
            let dusk = Dome::new(&air, at(elevation), &SUN);
            let (low, high) = (dusk.radiance(at(2.0)), dusk.radiance(Vec3::Z));
            assert!(low.x > 1.2 * low.z && high.z > 1.3 * high.x, "{elevation}°: {low} and {high}");
        }
    }
}
