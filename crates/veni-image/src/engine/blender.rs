//! Blender: z up, the centre of the panorama at +x: the native frame. A sun shines along its −z; its energy times its colour is
//! irradiance, its angle the diameter.

use veni_light::progress::Observer;
use veni_light::sphere::Frame;

use super::light::{FramedSun, triple};
use super::{Folder, Sky};
use crate::Result;

pub(super) fn write(sky: &Sky<'_>, folder: &mut Folder, observer: &dyn Observer) -> Result<()> {
    folder.add_exr("sky.exr", sky.panorama)?;
    observer.advance(1);
    let sun = sky.sun.map(|sun| FramedSun::new(&sun, Frame::Blender));
    let light = sun.map_or(String::new(), |sun| {
        let (energy, colour) = sun.by_brightest();
        format!(
            "\nlight = bpy.data.lights.new(\"Sun\", \"SUN\")\nlight.energy, light.color, light.angle = {energy}, ({}), {}\n\
             sun = bpy.data.objects.new(\"Sun\", light)\nsun.rotation_mode = \"QUATERNION\"\n\
             sun.rotation_quaternion = mathutils.Vector(({})).to_track_quat(\"Z\", \"Y\")\n\
             bpy.context.scene.collection.objects.link(sun)\n",
            triple(colour),
            sun.diameter.to_radians(),
            triple(sun.direction)
        )
    });
    folder.add(
        "sky.py",
        format!(
            "import os\nimport bpy\nimport mathutils\n\n\
             world = bpy.data.worlds.new(\"Sky\")\nbpy.context.scene.world = world\nworld.use_nodes = True\n\
             nodes, links = world.node_tree.nodes, world.node_tree.links\n\
             image = nodes.new(\"ShaderNodeTexEnvironment\")\n\
             image.image = bpy.data.images.load(os.path.join(os.path.dirname(os.path.abspath(__file__)), \"sky.exr\"))\n\
             links.new(image.outputs[\"Color\"], nodes[\"Background\"].inputs[\"Color\"])\n\
             if hasattr(world, \"sun_threshold\"):\n    world.sun_threshold = 0  # EEVEE: the sun is a light already\n{light}"
        ),
    )?;
    folder.add(
        "README.txt",
        format!(
            "A sky for Blender. Either open sky.py in the text editor and run it, or\n\n    \
             blender scene.blend -P blender/sky.py\n\n\
             sky.exr  the panorama{}\nsky.py   world{}\n\n\
             z is up; the centre of the panorama is at +x. Strengths are in the panorama's own unit.\n",
            if sun.is_some() { " without the sun: nothing sparkles, and shadows are sharp" } else { "" },
            if sun.is_some() { " and sun lamp" } else { "" }
        ),
    )
}
