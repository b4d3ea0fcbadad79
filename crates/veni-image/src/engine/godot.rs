//! Godot 4: y up. A panorama's centre is at +z; turned by half a turn, it is at −z, where a camera without rotation looks. Godot
//! filters by itself. A directional light's energy is irradiance over π, its colour sRGB-encoded, its z axis points to the sun.

use veni_light::progress::Observer;
use veni_light::sphere::Frame;

use super::light::{FramedSun, triple};
use super::{Folder, Sky};
use crate::Result;
use crate::tonemap::srgb;

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    folder.add_exr("sky.exr", sky.panorama)?;
    observer.advance(1);
    // the turned sky's frame is Bevy's
    let sun = sky.sun.map(|sun| FramedSun::new(&sun, Frame::Bevy));
    let light = sun.map_or(String::new(), |sun| {
        let (brightest, colour) = sun.by_brightest();
        let [x, y, z] = sun.basis();
        let rows = [0, 1, 2].map(|r| triple([x[r], y[r], z[r]])).join(", ");
        format!(
            "\n[node name=\"Sun\" type=\"DirectionalLight3D\" parent=\".\"]\n\
             transform = Transform3D({rows}, 0, 0, 0)\nlight_color = Color({}, 1)\nlight_energy = {}\n\
             light_angular_distance = {}\nshadow_enabled = true\n",
            triple(colour.map(srgb)),
            brightest / std::f32::consts::PI,
            sun.diameter
        )
    });
    folder.add(
        "sky.tscn",
        format!(
            "[gd_scene load_steps=5 format=3]\n\n\
             [ext_resource type=\"Texture2D\" path=\"sky.exr\" id=\"1\"]\n\n\
             [sub_resource type=\"PanoramaSkyMaterial\" id=\"2\"]\npanorama = ExtResource(\"1\")\n\n\
             [sub_resource type=\"Sky\" id=\"3\"]\nsky_material = SubResource(\"2\")\n\n\
             [sub_resource type=\"Environment\" id=\"4\"]\nbackground_mode = 2\nsky = SubResource(\"3\")\n\
             sky_rotation = Vector3(0, 3.1415927, 0)\n\n\
             [node name=\"Sky\" type=\"Node3D\"]\n\n\
             [node name=\"WorldEnvironment\" type=\"WorldEnvironment\" parent=\".\"]\nenvironment = SubResource(\"4\")\n{light}"
        ),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for Godot 4. Copy the folder into the project and drag sky.tscn into the scene, or\n\n    \
             add_child(load(\"res://godot/sky.tscn\").instantiate())\n\n\
             sky.exr   the panorama{}\nsky.tscn  environment{}\n\n\
             y is up; the centre of the panorama is at -z, where a camera without rotation looks.\n",
            if sun.is_some() { " without the sun, so that nothing sparkles" } else { "" },
            if sun.is_some() { " and sun" } else { "" }
        ),
    )
}
