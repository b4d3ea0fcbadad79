//! Bevy 0.20: y up, the centre of the panorama at −z. Cubes are looked up with z negated, perceptual roughness p at level p (M − 1);
//! the diffuse map holds E/π. `DirectionalLight::illuminance` is lux, `intensity` and `brightness` cd/m² per unit of the files.

use veni_light::light::{CubeAxes, CubeMap};
use veni_light::progress::Observer;
use veni_light::sphere::Frame;

use super::light::FramedSun;
use super::{Engine, Folder, Sky};
use crate::Result;
use crate::texture::{TexelFormat, ktx2};

/// Faces of the diffuse cube.
pub(super) const DIFFUSE: usize = 32;
/// The largest face of a background.
const LARGEST: usize = 2048;

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    let axes = CubeAxes::BEVY;
    let Some(levels) = Engine::Bevy.levels(sky.size) else { unreachable!("Bevy looks up levels") };
    let specular = sky.prefilter.specular(levels, axes, |_| observer.advance(1));
    folder.add("specular.ktx2", ktx2(&specular, TexelFormat::E5B9G9R9)?)?;
    let diffuse = sky.prefilter.diffuse(DIFFUSE.min(sky.size), axes);
    observer.advance(1);
    folder.add("diffuse.ktx2", ktx2(&[diffuse], TexelFormat::E5B9G9R9)?)?;
    let background = background(sky, axes)?;
    observer.advance(1);
    folder.add("skybox.ktx2", ktx2(&[background], TexelFormat::E5B9G9R9)?)?;
    let k = float(sky.exposure);
    let sun = sky.sun.map(|sun| FramedSun::new(&sun, Frame::Bevy));
    let light = sun.map_or(String::new(), |sun| {
        let (y, colour) = sun.by_luminance();
        format!(
            "    commands.spawn((\n        DirectionalLight {{ illuminance: {}, color: Color::linear_rgb({}), shadow_maps_enabled: true, ..default() }},\n        Transform::default().looking_to(Vec3::new({}), Vec3::Y),\n    ));\n",
            float(sky.exposure * f64::from(y)),
            floats(colour),
            floats(sun.away())
        )
    });
    folder.add(
        "sky.rs",
        format!(
            "use bevy::{{camera::Hdr, light::Skybox, prelude::*}};\n\n\
             /// Lights the scene: give it the camera. The files are in assets/sky.\n\
             pub fn sky(commands: &mut Commands, assets: &AssetServer, camera: Entity) {{\n    \
             // Bevy's own 80 cd/m2 from everywhere would come on top\n    \
             commands.insert_resource(GlobalAmbientLight::NONE);\n    \
             commands.entity(camera).insert((\n        Hdr,\n        \
             EnvironmentMapLight {{ diffuse_map: assets.load(\"sky/diffuse.ktx2\"), specular_map: assets.load(\"sky/specular.ktx2\"), intensity: {k}, ..default() }},\n        \
             Skybox {{ image: Some(assets.load(\"sky/skybox.ktx2\")), brightness: {k}, ..default() }},\n    ));\n{light}}}\n"
        ),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for Bevy 0.20. Copy the .ktx2 files to assets/sky/ and sky.rs into your sources, then\n\n    \
             let camera = commands.spawn(Camera3d::default()).id();\n    sky(&mut commands, &assets, camera);\n\n\
             specular.ktx2  GGX levels, perceptual roughness 0 to 1 in even steps{without}\n\
             diffuse.ktx2   irradiance / pi{without}\n\
             skybox.ktx2    what the camera sees\n\n\
             y is up; the centre of the panorama is at -z, where a camera without rotation looks.\n\
             One unit of radiance in the files is {k} cd/m2; sun and sky share that constant. sky.rs takes Bevy's own ambient\n\
             light (80 cd/m2 by default) away.\n",
            without = if sun.is_some() { ", without the sun" } else { "" }
        ),
    )?;
    Ok(())
}

/// The background as a cube of about the panorama's own resolution.
pub(super) fn background(sky: &Sky<'_>, axes: CubeAxes) -> Result<CubeMap> {
    let size = (sky.background.grid().width / 4).clamp(1, LARGEST);
    Ok(CubeMap::of_map(sky.background.environment()?, size, axes))
}

/// A number as Rust writes a float.
fn float(v: f64) -> String {
    format!("{:?}", v as f32)
}

fn floats(v: [f32; 3]) -> String {
    format!("{:?}, {:?}, {:?}", v[0], v[1], v[2])
}
