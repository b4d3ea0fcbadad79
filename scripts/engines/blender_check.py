"""Blender's Cycles renders its folder: a white diffuse plane, and a pole that throws a shadow."""

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

import sky


def build(folder):
    """A plane at z = 0 and a pole at the origin, under the folder's own script."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=40)
    plane = bpy.context.object
    bpy.ops.mesh.primitive_cylinder_add(radius=0.05, depth=2, location=(0, 0, 1))
    pole = bpy.context.object
    for thing, albedo in [(plane, 1.0), (pole, 0.0)]:
        material = bpy.data.materials.new("m")
        material.use_nodes = True
        nodes = material.node_tree.nodes
        nodes.clear()
        diffuse, out = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
        diffuse.inputs["Color"].default_value = (albedo, albedo, albedo, 1)
        material.node_tree.links.new(diffuse.outputs[0], out.inputs[0])
        thing.data.materials.append(material)
    script = folder / "sky.py"
    exec(compile(script.read_text(), script, "exec"), {"__file__": str(script)})
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.max_bounces = 0
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.02
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def radiance(scene, place, x, y, samples):
    """Mean radiance that the plane sends upwards at (x, y)."""
    scene.camera.location = (x, y, 1)
    scene.cycles.samples = samples
    scene.render.filepath = str(place / "out.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath, check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return pixels.mean(0)


def main():
    binary, checks = Path(sys.argv[1]).resolve(), sky.Checks()
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        folder, scale = sky.folder(binary, place, "blender")
        image = sky.read_hdr(place / "sky.hdr")
        scene = build(folder)
        expected = scale * sky.irradiance(image, [0, 0, 1]) / np.pi
        checks.within("plane in the open", radiance(scene, place, 12, 12, 1024), expected, 0.01)
        away = -sky.SUN[:2] / np.hypot(*sky.SUN[:2])
        for turn, name in [(1, "away from the sun"), (-1, "towards the sun")]:
            x, y = turn * away
            share = (radiance(scene, place, x, y, 256) / expected).mean()
            checks.say(f"a metre from the pole, {name}", (share < 0.8) == (turn == 1), f"{share:.3f} of the open plane")
    checks.end()


main()
