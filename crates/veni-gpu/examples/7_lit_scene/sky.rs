//! What a renderer loads of a sky: cubes of radiance, the split-sum table, a panorama for the background, the sun. Axes are the
//! renderer's: y up, the centre of the panorama at +x (glTF's frame); cubes are looked up by directions as they are.

use std::path::Path;

use serde_json::Value;
use veni_image::{Panorama, Picture};
use veni_light::light::{CompactLight, CubeAxes, CubeMap, Dfg, Law, Levels, Light, Prefilter};
use veni_light::sphere::{Equirect, Frame};

use super::Result;

/// Faces of the sharpest reflections, as `ibl` has them.
const SIZE: usize = 256;
/// Faces of the diffuse cube.
const DIFFUSE: usize = 32;

/// A square image, or six on top of each other.
#[derive(Clone, Debug)]
pub(crate) struct Texels {
    pub(crate) size: u32,
    pub(crate) rgb: Vec<[f32; 3]>,
}

/// A directional light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sun {
    /// Towards it.
    pub(crate) direction: [f32; 3],
    /// At normal incidence.
    pub(crate) irradiance: [f32; 3],
    /// Angular radius, radians.
    pub(crate) radius: f32,
}

/// Light without the sun, and the sun.
#[derive(Clone, Debug)]
pub(crate) struct Sky {
    /// GGX levels at even steps of perceptual roughness, from a mirror's to 1.
    pub(crate) specular: Vec<Texels>,
    /// Irradiance over π.
    pub(crate) diffuse: Texels,
    /// Columns n·v, rows perceptual roughness: reflectance is mix(x, y, f0).
    pub(crate) dfg: Texels,
    /// Behind everything; native axes.
    pub(crate) panorama: Panorama,
    pub(crate) sun: Option<Sun>,
}

impl Sky {
    /// A folder of `veni-cli ibl --engine any`.
    pub(crate) fn load(folder: &Path) -> Result<Self> {
        let image = |name: &str| -> Result<Texels> {
            let picture = Picture::read(folder.join(name))?;
            Ok(Texels { size: picture.size()[0] as u32, rgb: picture.pixels().to_vec() })
        };
        let light: Value = serde_json::from_slice(&std::fs::read(folder.join("light.json"))?)?;
        let steps = light["roughness"].as_array().ok_or("light.json has no roughness")?.len();
        let three = |value: &Value| [0, 1, 2].map(|k| value[k].as_f64().unwrap_or(f64::NAN) as f32);
        let sun = light["sun"].as_object().map(|sun| Sun {
            direction: Frame::Gltf.from_native(three(&sun["direction"])),
            irradiance: three(&sun["irradiance"]),
            radius: sun["radius"].as_f64().unwrap_or(f64::NAN).to_radians() as f32,
        });
        Ok(Self {
            specular: (0..steps).map(|k| image(&format!("specular_{k}.exr"))).collect::<Result<_>>()?,
            diffuse: image("diffuse.exr")?,
            dfg: image("dfg.exr")?,
            panorama: Panorama::read(folder.join("sky.exr"))?,
            sun,
        })
    }

    /// The same by the library, from a clear sky with a sun.
    pub(crate) fn made_here() -> Result<Self> {
        let mut sky = Panorama::from_fn(Equirect::new(1024, 512), |[.., z]| {
            if z < 0.0 { [0.12, 0.1, 0.08] } else { [0.5, 0.7 + 0.2 * z, 1.0 + 0.4 * z] }
        });
        let sun = CompactLight::new([0.48, -0.6, 0.64], [6.0, 5.0, 4.0], CompactLight::SUN_RADIUS);
        sun.add_to(sky.grid(), sky.pixels_mut());
        Self::of(&sky)
    }

    /// Any panorama: its sun taken out, the rest prefiltered.
    fn of(panorama: &Panorama) -> Result<Self> {
        let light = Light::of(panorama.environment()?);
        let rest = Panorama::new(light.residual().grid(), light.residual().pixels().to_vec());
        // only the sun becomes a directional light: lamps go back into the map
        let mut pixels = rest.pixels().to_vec();
        let lamps = light.lights().iter().filter(|lamp| Some(*lamp) != light.sun());
        lamps.for_each(|lamp| lamp.add_to(rest.grid(), &mut pixels));
        let rest = Panorama::new(rest.grid(), pixels);
        let levels = Levels::down_to(SIZE, 8, Law::Linear);
        let prefilter = Prefilter::new(rest.environment()?, &[levels]);
        let texels = |cube: CubeMap| Texels { size: cube.size() as u32, rgb: cube.texels().to_vec() };
        let dfg = Dfg::new(128);
        let sun = light.sun().map(|sun| Sun {
            direction: Frame::Gltf.from_native(sun.direction),
            irradiance: sun.irradiance,
            radius: sun.radius,
        });
        Ok(Self {
            specular: prefilter.specular(levels, CubeAxes::GLTF, |_| ()).into_iter().map(texels).collect(),
            diffuse: texels(prefilter.diffuse(DIFFUSE, CubeAxes::GLTF)),
            dfg: Texels { size: 128, rgb: dfg.values().iter().map(|&[x, y]| [x, y, 0.0]).collect() },
            sun,
            panorama: rest,
        })
    }

    /// What the ground receives, from the pixels of the panorama and the sun alone: no prefiltered map, no harmonics.
    pub(crate) fn irradiance_of_the_ground(&self) -> [f32; 3] {
        let grid = self.panorama.grid();
        let mut sum = [0.0f64; 3];
        for (k, (direction, pixel)) in grid.directions().iter().zip(self.panorama.pixels()).enumerate() {
            let weight = f64::from(direction[2].max(0.0)) * grid.solid_angle(k / grid.width);
            sum = [0, 1, 2].map(|c| sum[c] + weight * f64::from(pixel[c]));
        }
        let sun = self.sun.map_or([0.0; 3], |sun| sun.irradiance.map(|e| e * sun.direction[1].max(0.0)));
        [0, 1, 2].map(|c| sum[c] as f32 + sun[c])
    }
}
