//! glTF with EXT_lights_image_based and KHR_lights_punctual, for Babylon.js' loader, which alone reads the first of them.
//!
//! The loader mirrors glTF's x into its left-handed world and looks cubes and harmonics up there: v = (−nx, nz, −ny), as three.js
//! does with its cubes. Levels are even in perceptual roughness, images RGBD, diffuse light harmonics of irradiance. A directional
//! light shines along its node's −z.

use veni_light::light::CubeAxes;
use veni_light::progress::Observer;
use veni_light::sphere::{CubeFace, Frame};

use super::babylon::scale;
use super::light::{FramedSun, triple};
use super::{Engine, Folder, Sky};
use crate::Result;
use crate::texture::rgbd_png;

/// Of nine harmonics, those that change sign with x: x, xy, zx.
const ODD_IN_X: [usize; 3] = [3, 4, 7];

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    let Some(levels) = Engine::Gltf.levels(sky.size) else { unreachable!("glTF has levels") };
    let mut cubes = sky.prefilter.specular(levels, CubeAxes::THREE, |_| observer.advance(1));
    let factor = scale(&mut cubes);
    let (mut data, mut views) = (Vec::new(), Vec::new());
    for cube in &cubes {
        for face in CubeFace::ALL {
            let png = rgbd_png(cube.size(), cube.face(face))?;
            views.push(format!(
                "{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{}}}",
                data.len(),
                png.len()
            ));
            data.extend(png);
            data.resize(data.len().next_multiple_of(4), 0);
        }
    }
    let images: Vec<String> =
        (0..views.len()).map(|k| format!("{{\"bufferView\":{k},\"mimeType\":\"image/png\"}}")).collect();
    let faces: Vec<String> = (0..cubes.len())
        .map(|k| format!("[{}]", (6 * k..6 * k + 6).map(|i| i.to_string()).collect::<Vec<_>>().join(",")))
        .collect();
    let harmonics: Vec<String> = (sky.sh.gltf().iter().enumerate())
        .map(|(k, term)| {
            let sign = if ODD_IN_X.contains(&k) { -factor } else { factor };
            format!("[{}]", triple(term.map(|v| v * sign)))
        })
        .collect();
    let (nodes, punctual) = sky.sun.map_or((String::new(), String::new()), |sun| {
        let sun = FramedSun::new(&sun, Frame::Gltf);
        let (intensity, colour) = sun.by_brightest();
        let axes = sun.basis().map(|axis| format!("{},0", triple(axis))).join(",");
        (
            format!(
                "\"nodes\":[{{\"name\":\"Sun\",\"matrix\":[{axes},0,0,0,1],\"extensions\":{{\"KHR_lights_punctual\":{{\"light\":0}}}}}}],"
            ),
            format!(
                ",\"KHR_lights_punctual\":{{\"lights\":[{{\"type\":\"directional\",\"color\":[{}],\"intensity\":{intensity}}}]}}",
                triple(colour)
            ),
        )
    });
    let (used, in_scene) =
        if sky.sun.is_some() { (",\"KHR_lights_punctual\"", "\"nodes\":[0],") } else { ("", "") };
    let json = format!(
        "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"veni {}\"}},\"extensionsUsed\":[\"EXT_lights_image_based\"{used}],{nodes}\
         \"scene\":0,\"scenes\":[{{{in_scene}\"extensions\":{{\"EXT_lights_image_based\":{{\"light\":0}}}}}}],\
         \"buffers\":[{{\"byteLength\":{}}}],\"bufferViews\":[{}],\"images\":[{}],\
         \"extensions\":{{\"EXT_lights_image_based\":{{\"lights\":[{{\"intensity\":1,\"rotation\":[0,0,0,1],\
         \"irradianceCoefficients\":[{}],\"specularImageSize\":{},\"specularImages\":[{}]}}]}}{punctual}}}}}",
        env!("CARGO_PKG_VERSION"),
        data.len(),
        views.join(","),
        images.join(","),
        harmonics.join(","),
        sky.size,
        faces.join(",")
    );
    folder.add("sky.glb", container(json.into_bytes(), &data))?;
    folder.add(
        "README.txt",
        format!(
            "A sky as glTF, for Babylon.js' loader (EXT_lights_image_based; other programs ignore it and keep the sun).\n\n    \
             await BABYLON.AppendSceneAsync('gltf/sky.glb', scene);\n    scene.environmentTexture.level = {};\n    \
             scene.environmentTexture.gammaSpace = false;  // the loader leaves it on, and reflections are decoded twice\n\n\
             sky.glb  GGX levels (8-bit RGBD) and irradiance harmonics{}\n\n\
             Radiance in the file is that of the panorama times {factor}; the level makes up for it.\n",
            1.0 / factor,
            if sky.sun.is_some() { ", without the sun, which is a directional light (KHR_lights_punctual)" } else { "" }
        ),
    )
}

/// GLB: header, JSON chunk, binary chunk, each padded to four bytes.
fn container(mut json: Vec<u8>, data: &[u8]) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    let whole = 12 + 8 + json.len() + 8 + data.len();
    for word in [2, whole as u32, json.len() as u32] {
        file.extend(word.to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(json);
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(data);
    file
}
