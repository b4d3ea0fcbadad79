//! Air: molecules, aerosol and ozone around a spherical earth, and the light they scatter. MODEL (65, 66).
//!
//! Densities and phase functions as in Bruneton & Neyret (EGSR 2008); light scattered more than once by the isotropic
//! closed form of Hillaire (EGSR 2020); aerosol from turbidity T by Ångström's law with the coefficient of Preetham,
//! Shirley & Smits (SIGGRAPH 1999): optical depth at the zenith β λ^−1.3, λ in µm, β = 0.04608 T − 0.04586.
//! Lengths are kilometres.

mod columns;

use columns::{Columns, columns, densities};

use super::spectrum::{BANDS, OZONE, Spectrum, WAVELENGTHS};

/// Radius of the earth.
const GROUND: f64 = 6360.0;
/// Radius of the top of the atmosphere.
const TOP: f64 = 6460.0;
/// Scale height of molecules.
pub(super) const RAYLEIGH_HEIGHT: f32 = 8.0;
/// Scale height of aerosol.
pub(super) const MIE_HEIGHT: f32 = 1.2;
/// Share of light that aerosol scatters rather than absorbs.
const MIE_ALBEDO: f32 = 0.92;
/// Angular radius of the sun, radians: 6.8e-5 sr.
pub(super) const SUN_RADIUS: f64 = 0.004_652;

/// The atmosphere of a scene.
#[derive(Clone, Debug)]
pub(super) struct Atmosphere {
    /// Scattering by molecules at sea level, per km.
    pub(super) rayleigh: Spectrum,
    /// Extinction by aerosol at sea level, per km.
    pub(super) mie: Spectrum,
    /// Absorption by ozone at its peak, per km.
    ozone: Spectrum,
    /// Lambert albedo of the ground.
    albedo: f32,
    /// Logarithm of the light scattered more than once, as radiance per irradiance of the sun: `MS_HEIGHTS` ×
    /// `MS_SUNS`. It falls by orders of magnitude at dusk, which a straight line between two nodes would overstate.
    multiple: Vec<Spectrum>,
}

const MS_HEIGHTS: usize = 9;
const MS_SUNS: usize = 22;
/// The lowest sun in the table of multiple scattering, degrees: below, hardly any air is lit.
const MS_LOWEST: f32 = -17.0;

/// A point of a ray on its way through the air.
pub(super) struct Step {
    /// Height above the ground.
    pub(super) height: f64,
    /// Cosine of the sun's zenith angle there.
    pub(super) sun: f64,
    /// Length of this step.
    pub(super) length: f32,
    /// Transmittance from the start of the ray to this step.
    pub(super) transmittance: Spectrum,
    /// Densities of molecules, aerosol, ozone.
    pub(super) density: Columns,
}

/// x⁻⁴, correctly rounded. Of `powi` the last bit depends on whether the compiler knows x, and so on the profile.
fn inverse_fourth(x: f32) -> f32 {
    let square = f64::from(x) * f64::from(x);
    (1.0 / (square * square)) as f32
}

impl Atmosphere {
    /// `ozone` is in Dobson units.
    pub(super) fn new(turbidity: f32, ozone: f32, albedo: f32) -> Self {
        let beta = (0.046_08 * turbidity - 0.045_86).max(1e-3);
        let mut this = Self {
            rayleigh: WAVELENGTHS.map(|w| 1.240_62e-3 * inverse_fourth(w * 1e-3)),
            mie: WAVELENGTHS.map(|w| beta * (w * 1e-3).powf(-1.3) / MIE_HEIGHT),
            // a layer as high as its peak and 15 km thick
            ozone: OZONE.map(|sigma| sigma * ozone * 2.687e20 / 15e3 * 1e3),
            albedo,
            multiple: Vec::new(),
        };
        this.multiple = this.multiple_scattering();
        this
    }

    /// Scattering coefficients at this density.
    pub(super) fn scattering(&self, density: Columns) -> (Spectrum, Spectrum) {
        let rayleigh = self.rayleigh.map(|v| v * density[0]);
        (rayleigh, self.mie.map(|v| MIE_ALBEDO * v * density[1]))
    }

    /// Optical depth of these columns.
    fn depth(&self, c: Columns) -> Spectrum {
        std::array::from_fn(|k| self.rayleigh[k] * c[0] + self.mie[k] * c[1] + self.ozone[k] * c[2])
    }

    /// Transmittance towards the sun, seen from `height` at cosine `sun` of the zenith angle; fades to 0 while the
    /// disc sinks below the horizon.
    pub(super) fn to_sun(&self, height: f64, sun: f64) -> Spectrum {
        let r = GROUND + height;
        let horizon = -(1.0 - (GROUND / r).powi(2)).max(0.0).sqrt();
        let visible = ((sun - horizon) / (2.0 * SUN_RADIUS) + 0.5).clamp(0.0, 1.0) as f32;
        if visible == 0.0 {
            return [0.0; BANDS];
        }
        self.depth(columns(height, sun.max(horizon))).map(|d| visible * (-d).exp())
    }

    /// Walks a ray from `height` upwards or downwards (cosine `mu` of its zenith angle) through all the air, with
    /// the sun at zenith cosine `sun` at the start and `cos_sun` between ray and sun. Returns whether it ends on the
    /// ground.
    pub(super) fn walk(
        &self,
        [height, mu, sun, cos_sun]: [f64; 4],
        steps: usize,
        mut visit: impl FnMut(Step),
    ) -> bool {
        let r = GROUND + height;
        let below = r * r * (mu * mu - 1.0) + GROUND * GROUND;
        let on_ground = mu < 0.0 && below >= 0.0;
        let end = if on_ground {
            -r * mu - below.sqrt()
        } else {
            -r * mu + (r * r * (mu * mu - 1.0) + TOP * TOP).max(0.0).sqrt()
        };
        let mut transmittance = [1.0; BANDS];
        for k in 0..steps {
            // steps grow with distance, since near air is dense and far air is thin
            let edge = |k: usize| end * (k as f64 / steps as f64).powi(2);
            let (from, to) = (edge(k), edge(k + 1));
            let t = 0.5 * (from + to);
            let there = (r * r + 2.0 * r * mu * t + t * t).sqrt();
            let h = (there - GROUND).max(0.0);
            let density = densities(h as f32);
            let length = (to - from) as f32;
            visit(Step { height: h, sun: (r * sun + t * cos_sun) / there, length, transmittance, density });
            let depth = self.depth(density);
            transmittance.iter_mut().zip(depth).for_each(|(t, d)| *t *= (-d * length).exp());
        }
        on_ground
    }

    /// Radiance scattered towards anywhere after more than one scattering, per irradiance of the sun and per unit of
    /// scattering coefficient.
    pub(super) fn multiple(&self, height: f64, sun: f64) -> Spectrum {
        let elevation = sun.clamp(-1.0, 1.0).asin().to_degrees() as f32;
        if elevation < MS_LOWEST {
            return [0.0; BANDS];
        }
        let u = ((elevation - MS_LOWEST) / (90.0 - MS_LOWEST)).sqrt() * (MS_SUNS - 1) as f32;
        let v = ((height as f32 / 60.0).min(1.0)).sqrt() * (MS_HEIGHTS - 1) as f32;
        let (i, j) = ((u as usize).min(MS_SUNS - 2), (v as usize).min(MS_HEIGHTS - 2));
        let (s, t) = (u - i as f32, v - j as f32);
        let at = |j: usize, i: usize| &self.multiple[j * MS_SUNS + i];
        let (a, b, c, d) = (at(j, i), at(j, i + 1), at(j + 1, i), at(j + 1, i + 1));
        std::array::from_fn(|k| {
            ((1.0 - t) * (a[k] + s * (b[k] - a[k])) + t * (c[k] + s * (d[k] - c[k]))).exp()
        })
    }

    fn multiple_scattering(&self) -> Vec<Spectrum> {
        const DIRECTIONS: usize = 24;
        const STEPS: usize = 12;
        let mut table = Vec::with_capacity(MS_HEIGHTS * MS_SUNS);
        for j in 0..MS_HEIGHTS {
            let height = 60.0 * (j as f64 / (MS_HEIGHTS - 1) as f64).powi(2);
            for i in 0..MS_SUNS {
                let u = i as f64 / (MS_SUNS - 1) as f64;
                let elevation = f64::from(MS_LOWEST) + (90.0 - f64::from(MS_LOWEST)) * u * u;
                let (sun, sun_x) = elevation.to_radians().sin_cos();
                let (mut second, mut again) = ([0f32; BANDS], [0f32; BANDS]);
                for n in 0..DIRECTIONS {
                    // a spiral of Fibonacci covers the sphere evenly
                    let mu = 1.0 - 2.0 * (n as f64 + 0.5) / DIRECTIONS as f64;
                    let x = (1.0 - mu * mu).sqrt() * (2.399_963 * n as f64).cos();
                    let mut last = [1.0; BANDS];
                    let on_ground = self.walk([height, mu, sun, mu * sun + x * sun_x], STEPS, |step| {
                        let (rayleigh, mie) = self.scattering(step.density);
                        let depth = self.depth(step.density);
                        let lit = self.to_sun(step.height, step.sun);
                        for k in 0..BANDS {
                            let through = (-depth[k] * step.length).exp();
                            let scattered = step.transmittance[k] * (rayleigh[k] + mie[k]) * (1.0 - through)
                                / depth[k].max(1e-9);
                            second[k] += scattered * lit[k] / (4.0 * std::f32::consts::PI);
                            again[k] += scattered;
                            last[k] = step.transmittance[k] * through;
                        }
                    });
                    if on_ground {
                        let lit = self.to_sun(0.0, sun);
                        for k in 0..BANDS {
                            second[k] +=
                                last[k] * lit[k] * sun.max(0.0) as f32 * self.albedo / std::f32::consts::PI;
                        }
                    }
                }
                table.push(std::array::from_fn(|k| {
                    let (second, again) = (second[k] / DIRECTIONS as f32, again[k] / DIRECTIONS as f32);
                    (second / (1.0 - again.min(0.95))).max(1e-20).ln()
                }));
            }
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{SUN, luminance, to_rgb};

    #[test]
    fn columns_at_the_zenith_are_the_scale_heights() {
        let up = columns(0.0, 1.0);
        for (column, exact) in up.iter().zip([RAYLEIGH_HEIGHT, MIE_HEIGHT, 15.0]) {
            assert!((column - exact).abs() < 3e-3 * exact, "{up:?}");
        }
        // √(πR/2H) at the horizon without refraction (Chapman 1931); Kasten & Young (1989) higher up
        for (elevation, mass, tolerance) in [(0f64, 35.34, 0.1), (10.0, 5.59, 0.1), (30.0, 1.994, 0.02)] {
            let ours = columns(0.0, elevation.to_radians().sin())[0] / RAYLEIGH_HEIGHT;
            assert!((ours - mass).abs() < tolerance, "{elevation}°: {ours} air masses");
        }
    }

    #[test]
    fn direct_sun_has_the_illuminance_of_textbooks() {
        let air = Atmosphere::new(2.5, 300.0, 0.2);
        let illuminance = |elevation: f64| {
            let t = air.to_sun(0.0, elevation.to_radians().sin());
            to_rgb(&std::array::from_fn(|k| t[k] * SUN[k]))
        };
        let noon = luminance(illuminance(60.0));
        assert!((85.0..115.0).contains(&noon), "{noon} klx");
        let low = illuminance(2.0);
        assert!(low.x > 3.0 * low.z && luminance(low) < 0.25 * noon, "a low sun is dim and red: {low}");
        assert_eq!(luminance(illuminance(-1.0)), 0.0);
    }
}
