//! Filament: y up, the centre of the panorama at +z; cubes are looked up by the world's directions. Perceptual roughness p is at
//! level M p (2 − p), diffuse light nine numbers of a polynomial of E/π. `IndirectLight` and the sun have cd/m² per unit and lux.

use veni_light::light::CubeAxes;
use veni_light::progress::Observer;
use veni_light::sphere::Frame;

use super::bevy::background;
use super::light::{FramedSun, triple};
use super::{Engine, Folder, Sky};
use crate::Result;
use crate::texture::ktx1;

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    let Some(levels) = Engine::Filament.levels(sky.size) else { unreachable!("Filament looks up levels") };
    let cubes = sky.prefilter.specular(levels, CubeAxes::FILAMENT, |_| observer.advance(1));
    let lines: String = (sky.sh.filament().iter()).map(|[r, g, b]| format!("{r} {g} {b}\n")).collect();
    folder.add("sky_ibl.ktx", ktx1(&cubes, &[("sh", &lines)])?)?;
    folder.add("sky_skybox.ktx", ktx1(&[background(sky, CubeAxes::FILAMENT)?], &[])?)?;
    observer.advance(1);
    folder.add("sh.txt", &lines)?;
    let k = sky.exposure;
    let sun = sky.sun.map(|sun| FramedSun::new(&sun, Frame::OpenExr));
    let light = sun.map_or(String::new(), |sun| {
        let (y, colour) = sun.by_luminance();
        format!(
            "    LightManager::Builder(LightManager::Type::SUN)\n        .direction({{{}}}).color({{{}}}).intensity({:?}f)\n        \
             .sunAngularRadius({:?}f).castShadows(true).build(engine, sun);\n    scene.addEntity(sun);\n",
            triple(sun.away()),
            triple(colour),
            (k * f64::from(y)) as f32,
            0.5 * sun.diameter
        )
    });
    folder.add(
        "sky.cpp",
        format!(
            "// Lights a scene. `ibl` and `box` are the bytes of sky_ibl.ktx and sky_skybox.ktx.\n\
             void sky(Engine& engine, Scene& scene, utils::Entity sun, image::Ktx1Bundle* ibl, image::Ktx1Bundle* box) {{\n    \
             math::float3 sh[9];\n    ibl->getSphericalHarmonics(sh);\n    \
             scene.setIndirectLight(IndirectLight::Builder().reflections(ktxreader::Ktx1Reader::createTexture(&engine, ibl, false))\n        \
             .irradiance(3, sh).intensity({:?}f).build(engine));\n    \
             scene.setSkybox(Skybox::Builder().environment(ktxreader::Ktx1Reader::createTexture(&engine, box, false)).build(engine));\n{light}}}\n",
            k as f32
        ),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for Filament.\n\n\
             sky_ibl.ktx     GGX levels ({} levels, R11F_G11F_B10F), and diffuse light under the key \"sh\"{}\n\
             sky_skybox.ktx  what the camera sees\n\
             sh.txt          the nine numbers of \"sh\", in the form that shaders take, without a window\n\
             sky.cpp         the calls that load them\n\n\
             y is up; the centre of the panorama is at +z. One unit of radiance is {k} cd/m2; sun and sky share that constant.\n",
            levels.count(),
            if sun.is_some() { "; both without the sun" } else { "" }
        ),
    )
}
