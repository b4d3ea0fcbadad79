//! three.js r187: y up, the centre of the panorama at +x. A cube texture of one's own is looked up with x negated; as a PMREM,
//! perceptual roughness p is at level M p (2 − p) and diffuse light is the last level times π. A directional light's intensity
//! times its colour is irradiance.

use veni_light::light::CubeAxes;
use veni_light::progress::Observer;
use veni_light::sphere::Frame;

use super::light::{FramedSun, triple};
use super::{Engine, Folder, Sky};
use crate::Result;
use crate::texture::{TexelFormat, ktx2};

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    let Some(levels) = Engine::Three.levels(sky.size) else { unreachable!("three.js looks up levels") };
    let cubes = sky.prefilter.specular(levels, CubeAxes::THREE, |_| observer.advance(1));
    folder.add("sky.ktx2", ktx2(&cubes, TexelFormat::Rgba16F)?)?;
    folder.add_exr("background.exr", sky.background)?;
    observer.advance(1);
    let sun = sky.sun.map(|sun| FramedSun::new(&sun, Frame::Gltf));
    let light = sun.map_or(String::new(), |sun| {
        let (intensity, colour) = sun.by_brightest();
        format!(
            "  const sun = new THREE.DirectionalLight(new THREE.Color({}), {intensity});\n  \
             sun.position.set({}).multiplyScalar(100);\n  sun.castShadow = true;\n  scene.add(sun, sun.target);\n",
            triple(colour),
            triple(sun.direction)
        )
    });
    folder.add(
        "sky.js",
        format!(
            "import * as THREE from 'three';\n\
             import {{ read }} from 'ktx-parse';\n\
             import {{ EXRLoader }} from 'three/addons/loaders/EXRLoader.js';\n\n\
             /** Lights a scene: `await sky(scene)`, from the folder of this file. */\n\
             export async function sky(scene, folder = new URL('.', import.meta.url)) {{\n  \
             const k = read(new Uint8Array(await (await fetch(new URL('sky.ktx2', folder))).arrayBuffer()));\n  \
             const faces = [0, 1, 2, 3, 4, 5].map((f) => ({{ width: k.pixelWidth, height: k.pixelHeight, mipmaps: k.levels.map((l, i) => {{\n    \
             const n = l.levelData.byteLength / 6, w = k.pixelWidth >> i;\n    \
             return {{ width: w, height: w, data: new Uint16Array(l.levelData.slice(f * n, (f + 1) * n).buffer) }};\n  \
             }}) }}));\n  \
             const env = new THREE.CompressedCubeTexture(faces, THREE.RGBAFormat, THREE.HalfFloatType);\n  \
             env.minFilter = THREE.LinearMipmapLinearFilter;\n  env.magFilter = THREE.LinearFilter;\n  \
             env.isPMREMTexture = true;\n  env.needsUpdate = true;\n  scene.environment = env;\n  \
             const back = await new EXRLoader().loadAsync(new URL('background.exr', folder).href);\n  \
             back.mapping = THREE.EquirectangularReflectionMapping;\n  scene.background = back;\n{light}  return env;\n}}\n"
        ),
    )?;
    let json = match sun {
        Some(sun) => {
            let (intensity, colour) = sun.by_brightest();
            format!(
                "{{\"position\":[{}],\"color\":[{}],\"intensity\":{intensity},\"diameter\":{}}}\n",
                triple(sun.direction),
                triple(colour),
                sun.diameter
            )
        }
        None => "null\n".to_owned(),
    };
    folder.add("sun.json", json)?;
    folder.add(
        "README.txt",
        format!(
            "A sky for three.js r187 or later (npm: three, ktx-parse). In a module beside this folder:\n\n    \
             import {{ sky }} from './three/sky.js';\n    await sky(scene);\n\n\
             sky.ktx2        GGX levels as a PMREM ({} levels, half floats){}\n\
             background.exr  what the camera sees; also a fallback for PMREMGenerator\n\
             sun.json        the sun: position (a direction), linear colour, intensity, diameter in degrees\n\n\
             y is up; the centre of the panorama is at +x. Intensities are in the panorama's own unit.\n\
             Shadows need renderer.shadowMap.enabled = true and the bounds of sun.shadow.camera.\n",
            levels.count(),
            if sun.is_some() { ", without the sun" } else { "" }
        ),
    )
}
