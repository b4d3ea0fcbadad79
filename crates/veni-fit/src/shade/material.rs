//! How a surface reflects: Lambert's law, and Blinn-Phong's lobe. MODEL (55, 57).

use std::f64::consts::{FRAC_1_PI, PI};

use super::ShadingForm;
use crate::{Error, Result};
use veni_light::vector::{add, dot, narrow, scaled};

/// What [`ShadingForm::Reference`] never goes below, with Blinn-Phong.
pub(super) const REFERENCE_FLOOR: f32 = 1e-3;

/// A linear colour for every pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Colour {
    /// The same everywhere.
    Uniform([f32; 3]),
    /// One per pixel of the surface, row-major.
    Map(Vec<[f32; 3]>),
}

/// The shiny part of a [`Material`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Specular {
    /// K_s: the fraction of light that comes straight down and leaves through the lobe.
    pub colour: [f32; 3],
    /// The exponent s of (n·h)^s.
    pub shininess: f32,
}

/// A diffuse colour and perhaps a specular lobe.
///
/// With unit normal n, direction l to the light, direction v to the camera and h = (l + v)/|l + v|, the
/// [physical](ShadingForm::Physical) reflectance is
///
/// > f = k_d/π + K_s (s + 2)(s + 4)/(8π (s + 2^{−s/2})) max(n·h, 0)^s
///
/// whose second term, times n·l, integrates to K_s over the hemisphere for v = n (F. Giesen, "Phong normalization
/// factor derivation", 2009) and to less for other v.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// k_d, the diffuse reflectance (albedo).
    pub diffuse: Colour,
    /// The lobe; `None` is Lambert's law alone.
    pub specular: Option<Specular>,
}

impl Material {
    /// Lambert's law: a diffuse reflectance, nothing else.
    pub fn lambert(albedo: Colour) -> Self {
        Self { diffuse: albedo, specular: None }
    }

    /// Blinn-Phong with the fraction `ks` (0 to 1) in the lobe and the rest diffuse: k_d = (1 − K_s) albedo.
    pub fn blinn_phong(albedo: Colour, ks: f32, shininess: f32) -> Self {
        let dim = |c: [f32; 3]| c.map(|v| (1.0 - ks) * v);
        let diffuse = match albedo {
            Colour::Uniform(c) => Colour::Uniform(dim(c)),
            Colour::Map(map) => Colour::Map(map.into_iter().map(dim).collect()),
        };
        Self { diffuse, specular: Some(Specular { colour: [ks; 3], shininess }) }
    }

    /// What no surface of `pixels` pixels can have.
    pub(super) fn check(&self, pixels: usize) -> Result<()> {
        let colours = match &self.diffuse {
            Colour::Uniform(c) => std::slice::from_ref(c),
            Colour::Map(map) if map.len() == pixels => map,
            Colour::Map(map) => {
                return Err(Error::invalid(format!(
                    "an albedo map of {} pixels for a surface of {pixels}: give one of the same size",
                    map.len()
                )));
            }
        };
        let fine = |c: &[f32; 3]| c.iter().all(|v| v.is_finite() && *v >= 0.0);
        if let Some(wrong) = colours.iter().find(|c| !fine(c)) {
            return Err(Error::invalid(format!(
                "{wrong:?} is not a reflectance: it must be finite, 0 or more"
            )));
        }
        if let Some(s) = &self.specular {
            if !fine(&s.colour) {
                return Err(Error::invalid(format!(
                    "{:?} is not a specular reflectance: it must be finite, 0 or more",
                    s.colour
                )));
            }
            if !(s.shininess.is_finite() && s.shininess >= 0.0) {
                return Err(Error::invalid(format!(
                    "shininess {}: it must be finite, 0 or more",
                    s.shininess
                )));
            }
        }
        Ok(())
    }
}

impl Colour {
    /// The colour of one pixel.
    pub(super) fn at(&self, pixel: usize) -> [f32; 3] {
        match self {
            Self::Uniform(c) => *c,
            Self::Map(map) => map[pixel],
        }
    }
}

/// The two lobes of one pixel, up to their colours: what light of unit radiance from a direction sends to the camera
/// per steradian.
pub(super) struct Lobes {
    form: ShadingForm,
    normal: [f64; 3],
    /// The view vector of h.
    view: [f64; 3],
    /// n · view.
    facing: f64,
    diffuse: f64,
    specular: f64,
    shininess: f64,
    /// Where n·h is less, the lobe is below 1e-13 of its peak and taken for 0 (ln x ≤ x − 1); at least 0.
    cutoff: f64,
}

impl Lobes {
    /// For a unit normal and the unit camera ray that meets it.
    pub(super) fn new(form: ShadingForm, normal: [f64; 3], ray: [f64; 3], shininess: f32) -> Self {
        let s = f64::from(shininess);
        let (view, diffuse, specular) = match form {
            ShadingForm::Physical => {
                let normalised = (s + 2.0) * (s + 4.0) / (8.0 * PI * (s + (-0.5 * s).exp2()));
                (scaled(ray, -1.0), FRAC_1_PI, normalised)
            }
            ShadingForm::Reference => (ray, 1.0, (s + 2.0) / (4.0 * (2.0 - (-0.5 * s).exp()))),
        };
        let cutoff = if s > 30.0 { 1.0 - 30.0 / s } else { 0.0 };
        Self { form, normal, view, facing: dot(normal, view), diffuse, specular, shininess: s, cutoff }
    }

    /// Lambert: max(n·l, 0), over π in the physical form.
    #[inline]
    pub(super) fn diffuse(&self, light: [f64; 3]) -> f64 {
        self.diffuse * dot(self.normal, light).max(0.0)
    }

    /// Blinn-Phong's lobe. A light exactly opposite to the view vector has no half vector and gives 0.
    #[inline]
    pub(super) fn specular(&self, light: [f64; 3]) -> f64 {
        let (cosine, x) = match self.form {
            ShadingForm::Physical => {
                let cosine = dot(self.normal, light);
                if cosine <= 0.0 {
                    return 0.0;
                }
                // most pairs are far down the lobe: decided without a root
                let half = add(light, self.view);
                let (along, square) = (cosine + self.facing, dot(half, half));
                if along <= 0.0 || along * along < self.cutoff * self.cutoff * square {
                    return 0.0;
                }
                (cosine, along / square.sqrt())
            }
            // a lobe without a cosine, lit from below the surface too
            ShadingForm::Reference => (1.0, f64::from(self.reference_cosine(light))),
        };
        if x <= self.cutoff {
            return 0.0;
        }
        cosine * self.specular * (self.shininess * x.ln()).exp()
    }

    /// n·h in single precision, step by step as in the reference implementation, the order of its sums included: with
    /// s = 500, the last bit of this number is 3e-5 of the result.
    fn reference_cosine(&self, light: [f64; 3]) -> f32 {
        let normalise = |v: [f32; 3]| {
            let length = (v[0] * v[0] + (v[1] * v[1] + v[2] * v[2])).sqrt();
            v.map(|c| c / length.max(1e-12))
        };
        let (light, view, normal) = (normalise(narrow(light)), narrow(self.view), narrow(self.normal));
        let half = normalise([0, 1, 2].map(|c| (light[c] + view[c]) / 2.0));
        dot(half, normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ lobe(l) dω over the sphere by the midpoint rule, for a view `tilt` radians from the normal.
    fn integral(lobes: &Lobes, lobe: impl Fn(&Lobes, [f64; 3]) -> f64) -> f64 {
        let (rows, columns) = (600, 200);
        let mut sum = 0.0;
        for j in 0..rows {
            let (sin_t, cos_t) = (PI * (j as f64 + 0.5) / rows as f64).sin_cos();
            for i in 0..columns {
                let (sin, cos) = (2.0 * PI * (i as f64 + 0.5) / columns as f64).sin_cos();
                sum += sin_t * lobe(lobes, [sin_t * cos, sin_t * sin, cos_t]);
            }
        }
        sum * 2.0 * PI * PI / (rows * columns) as f64
    }

    #[test]
    fn lobes_reflect_all_light_that_comes_straight_down_and_never_more() {
        for shininess in [0.0, 1.0, 5.0, 20.0, 100.0, 500.0] {
            for tilt in [0.0, 0.4, 0.8, 1.2, 1.5_f64] {
                let ray = [-tilt.sin(), 0.0, -tilt.cos()];
                let lobes = Lobes::new(ShadingForm::Physical, [0.0, 0.0, 1.0], ray, shininess);
                assert!((integral(&lobes, Lobes::diffuse) - 1.0).abs() < 1e-4);
                let specular = integral(&lobes, Lobes::specular);
                if tilt == 0.0 {
                    assert!((specular - 1.0).abs() < 2e-3, "s = {shininess}: {specular}");
                }
                assert!(specular < 1.0 + 2e-3, "s = {shininess}, view at {tilt}: {specular}");
            }
        }
    }

    #[test]
    fn opposite_directions_have_no_half_vector() {
        let lobes = Lobes::new(ShadingForm::Reference, [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], 0.0);
        assert_eq!(lobes.specular([0.0, 0.0, -1.0]), 0.0);
        // s = 0: (0 + 2)/(4 (2 − 1)) for every half vector above the surface
        assert_eq!(lobes.specular([0.0, 1.0, 0.0]), 0.5);
    }

    #[test]
    fn materials_that_cannot_be_are_refused() {
        let message = |m: Material| m.check(4).unwrap_err().to_string();
        assert!(message(Material::lambert(Colour::Map(vec![[1.0; 3]; 3]))).contains("same size"));
        assert!(message(Material::lambert(Colour::Uniform([f32::NAN; 3]))).contains("reflectance"));
        assert!(message(Material::blinn_phong(Colour::Uniform([1.0; 3]), 1.5, 2.0)).contains("-0.5"));
        assert!(
            message(Material::blinn_phong(Colour::Uniform([1.0; 3]), 0.5, -2.0)).contains("shininess -2")
        );
    }
}
