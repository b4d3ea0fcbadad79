//! A light in the order that `light_layout.wgsl` describes.

use std::f64::consts::PI;

use veni_light::light::sh::cosine_lobe;
use veni_light::light::{CompactLight, EnvironmentMap, Light, Sampler, Sh, SplitSampler};
use veni_light::sphere::Equirect;
use veni_light::{Error, Result};

use super::light_uniform::{LightUniform, MAX_LIGHTS, PackedDisc};

/// By which density the map is sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum LightDensity {
    /// By luminance: for samples of the light alone.
    #[default]
    Luminance,
    /// By luminance above the map's mean ([`Sampler::compensated`]): for use with a surface's own density by the balance
    /// heuristic, which then does not share what is even anyway.
    Compensated,
}

/// The three buffers of a light, for any API.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedLight {
    /// `veni_light`: [`LightUniform::to_bytes`].
    pub uniform: LightUniform,
    /// `veni_light_cells`: the bits of an f32 probability, and a pixel; 8 bytes each.
    pub cells: Vec<[u32; 2]>,
    /// `veni_light_texels`: W·H pixels (R, G, B, density in 1/sr), then cos θ of the H + 1 edges of rows, four to a texel; 16 bytes
    /// each.
    pub texels: Vec<[f32; 4]>,
}

/// Packs a light once; [`LightUniform::rotation_bytes`] rotates it. The sun, if there is one, is drawn as its disc; all
/// else, other compact lights as discs on pixels, is the map, of at most 2²³ pixels (larger ones are averaged). For a
/// map that is not to be split, take it with [`LightOptions::lights`](veni_light::light::LightOptions::lights) = 0. A
/// black light is drawn evenly.
///
/// # Errors
/// [`Error`] of kind `Invalid` if radiance is so large or small that a density or an irradiance leaves the range of f32.
pub fn pack_light(light: &Light, density: LightDensity) -> Result<PackedLight> {
    let pixels = light.without_sun();
    let map = EnvironmentMap::new(light.residual().grid(), &pixels)?;
    let sampler = match density {
        LightDensity::Luminance => Sampler::new(map),
        LightDensity::Compensated => Sampler::new(map).compensated(),
    };
    let split = light.sun().map(|sun| SplitSampler::new(*sun, sampler.clone()));
    let grid = sampler.grid();
    let edges = edges(grid);
    let cells: Vec<_> = sampler.table().map(|(keep, other)| [keep.to_bits(), other]).collect();
    let first = split.as_ref().map(|split| *split.sun());
    let rest = light.lights().others();
    let lights: Vec<_> = first.iter().chain(rest).take(MAX_LIGHTS).map(disc).collect();
    let half = 0.5 * PI / grid.height as f64;
    let uniform = LightUniform {
        rotation: [0.0, 1.0],
        size: [grid.width as u32, grid.height as u32],
        across: split.as_ref().map_or([[0.0; 3]; 2], SplitSampler::across),
        share: split.as_ref().map_or(0.0, SplitSampler::share),
        cap: first.map_or(0.0, |sun| cap(&sun) as f32),
        cells: cells.len() as u32,
        has_sun: first.is_some(),
        pole: half.sin().powi(2) as f32,
        lights,
        diffuse: diffuse(light.residual_sh()),
    };
    let texel = |rgb: &[f32; 3]| [rgb[0], rgb[1], rgb[2], sampler.density(*rgb)];
    let mut texels: Vec<_> = sampler.map().pixels().iter().map(texel).collect();
    if let Some(at) = texels.iter().position(|t| !t[3].is_finite()) {
        return Err(Error::invalid(format!(
            "the light of column {}, row {} ({:?}) is sampled with a density beyond the range of f32: scale the map",
            at % grid.width,
            at / grid.width,
            &texels[at][..3]
        )));
    }
    texels.extend(edges);
    if let Some(number) = uniform.numbers().find(|v| !v.is_finite()) {
        return Err(Error::invalid(format!(
            "the irradiance of this light leaves the range of f32 ({number}): scale the map"
        )));
    }
    Ok(PackedLight { uniform, cells, texels })
}

/// cos θ of the edges of all rows, four to a texel.
fn edges(grid: Equirect) -> Vec<[f32; 4]> {
    let heights: Vec<f32> =
        (0..=grid.height).map(|j| (PI * j as f64 / grid.height as f64).cos() as f32).collect();
    let four = |part: &[f32]| std::array::from_fn(|k| part.get(k).copied().unwrap_or(0.0));
    heights.chunks(4).map(four).collect()
}

fn disc(light: &CompactLight) -> PackedDisc {
    let cap = cap(light);
    PackedDisc {
        direction: light.direction,
        radius: light.radius,
        irradiance: light.irradiance,
        per_solid_angle: if cap > 0.0 { (0.5 / (PI * cap)) as f32 } else { 0.0 },
    }
}

/// 1 − cos of the radius.
fn cap(light: &CompactLight) -> f64 {
    2.0 * (0.5 * f64::from(light.radius)).sin().powi(2)
}

/// Irradiance by nine harmonics as a polynomial of the normal: A_l c_lm times the constants of the basis, LIGHT (10).
fn diffuse(sh: &Sh<2>) -> [[f32; 3]; 9] {
    let (one, two) = ((0.75 / PI).sqrt(), (3.75 / PI).sqrt());
    // Condon and Shortley's sign on odd m
    let constants =
        [(0.25 / PI).sqrt(), -one, one, -one, two, -two, 0.25 * (5.0 / PI).sqrt(), -two, 0.5 * two];
    let coefficients = sh.coefficients();
    std::array::from_fn(|k| coefficients[k].map(|c| (cosine_lobe(k.isqrt()) * constants[k] * c) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::light::LightOptions;

    fn light(value: f32) -> Light {
        let grid = Equirect::new(64, 32);
        Light::of(EnvironmentMap::new(grid, &vec![[value; 3]; grid.len()]).unwrap())
    }

    #[test]
    fn buffers_have_the_documented_sizes() {
        let grid = Equirect::new(96, 48);
        let mut pixels = vec![[0.3, 0.4, 0.6]; grid.len()];
        pixels[10 * 96 + 40] = [9e4, 8e4, 7e4];
        let light = Light::of(EnvironmentMap::new(grid, &pixels).unwrap());
        assert!(light.sun().is_some());
        let packed = pack_light(&light, LightDensity::Luminance).unwrap();
        assert_eq!(packed.cells.len(), 8192);
        assert_eq!(packed.texels.len(), grid.len() + 49usize.div_ceil(4));
        let bytes = packed.uniform.to_bytes();
        let float = |at: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| bytes[at + k]));
        assert_eq!([float(0), float(4)], [0.0, 1.0]);
        assert_eq!(float(28), packed.uniform.share);
        assert_eq!(float(64), light.lights()[0].direction[0]);
        assert_eq!(float(320), packed.uniform.diffuse[0][0]);
        assert_eq!(float(448), packed.uniform.diffuse[8][0]);
        // what the map and the sun hold together is what the panorama holds
        let solid_angle = |k: usize| grid.solid_angle(k / 96);
        let rest: f64 = (0..grid.len()).map(|k| solid_angle(k) * f64::from(packed.texels[k][0])).sum();
        let whole: f64 = (0..grid.len()).map(|k| solid_angle(k) * f64::from(pixels[k][0])).sum();
        let sun = f64::from(packed.uniform.lights[0].irradiance[0]);
        assert!(((rest + sun) / whole - 1.0).abs() < 1e-6);
        let density: f64 = (0..grid.len()).map(|k| solid_angle(k) * f64::from(packed.texels[k][3])).sum();
        assert!((density - 1.0).abs() < 1e-5, "{density}");
    }

    #[test]
    fn what_leaves_the_range_is_one_clear_error() {
        for value in [1e-42, 3e38] {
            let refused = pack_light(&light(value), LightDensity::Luminance).unwrap_err().to_string();
            assert!(refused.contains("range of f32") && refused.contains("scale the map"), "{refused}");
        }
        for value in [0.0, 1e-30, 1e30] {
            pack_light(&light(value), LightDensity::Luminance).unwrap();
        }
        let grid = Equirect::new(4, 2);
        let refused =
            LightOptions::default().of_pixels(grid, vec![[f32::NAN; 3]; 8]).unwrap_err().to_string();
        assert!(refused.contains("column 0, row 0"), "{refused}");
    }
}
