//! Babylon.js 9: y up, left-handed, the centre of the panorama at +z; cubes are looked up by the world's directions. Roughness α is
//! at level 0.8 log2(size α), diffuse light a polynomial. Radiance is stored up to 255; beyond it all levels are scaled down and
//! `level` scales them up. A directional light's intensity is irradiance.

use veni_light::light::{CubeAxes, CubeMap};
use veni_light::progress::Observer;

use super::light::triple;
use super::{Engine, Folder, Sky};
use crate::Result;
use crate::texture::env;

/// The largest radiance of RGBD.
const LARGEST: f32 = 255.0;

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    let Some(levels) = Engine::Babylon.levels(sky.size) else { unreachable!("Babylon.js looks up levels") };
    let mut cubes = sky.prefilter.specular(levels, CubeAxes::BABYLON, |_| observer.advance(1));
    let factor = scale(&mut cubes);
    let irradiance = sky.sh.babylon().map(|term| term.map(|v| v * factor));
    folder.add("sky.env", env(&cubes, &irradiance)?)?;
    let level = 1.0 / factor;
    let light = sky.sun.map_or(String::new(), |sun| {
        let v = CubeAxes::BABYLON.lookup(sun.direction);
        let brightest = sun.irradiance.into_iter().fold(0f32, f32::max);
        format!(
            "  const sun = new BABYLON.DirectionalLight('sun', new BABYLON.Vector3({}), scene);\n  \
             sun.diffuse = sun.specular = new BABYLON.Color3({});\n  sun.intensity = {brightest};\n",
            triple(v.map(|c| 0.0 - c)),
            triple(sun.irradiance.map(|e| e / brightest))
        )
    });
    folder.add(
        "sky.js",
        format!(
            "/** Lights a scene: `sky(BABYLON, scene, 'babylon/')`. */\n\
             export function sky(BABYLON, scene, folder = '') {{\n  \
             scene.environmentTexture = BABYLON.CubeTexture.CreateFromPrefilteredData(folder + 'sky.env', scene);\n  \
             scene.environmentTexture.level = {level};\n  \
             scene.createDefaultSkybox(scene.environmentTexture, true, 1000);\n{light}}}\n"
        ),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for Babylon.js 9.\n\n    import {{ sky }} from './babylon/sky.js';\n    sky(BABYLON, scene, 'babylon/');\n\n\
             sky.env  GGX levels down to one texel (8-bit RGBD) and diffuse light{}\n\
             sky.js   the calls that load it\n\n\
             y is up, left-handed; the centre of the panorama is at +z. Radiance in sky.env is that of the panorama times {factor};\n\
             scene.environmentTexture.level makes up for it.\n",
            if sky.sun.is_some() { ", without the sun" } else { "" }
        ),
    )
}

/// Brings all levels below the largest radiance by a power of two, and gives it.
pub(super) fn scale(cubes: &mut [CubeMap]) -> f32 {
    let texels = cubes.iter().flat_map(|cube| cube.texels().as_flattened());
    let brightest = texels.fold(0f32, |a, b| a.max(*b));
    let factor = (-(brightest / LARGEST).log2().ceil().max(0.0)).exp2();
    if factor < 1.0 {
        cubes
            .iter_mut()
            .flat_map(|cube| cube.texels_mut())
            .for_each(|texel| *texel = texel.map(|v| v * factor));
    }
    factor
}
