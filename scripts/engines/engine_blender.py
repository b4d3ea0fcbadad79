"""Blender's Cycles renders its folder."""

import math

import numpy as np

import job
import scene

TOLD = scene.told("blender")


def paint(bpy, thing, colour, metal=False, roughness=1.0):
    material = bpy.data.materials.new("m")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    surface, out = nodes.new("ShaderNodeBsdfGlossy" if metal else "ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    surface.inputs["Color"].default_value = (colour, colour, colour, 1)
    if metal:
        surface.distribution = "GGX"
        surface.inputs["Roughness"].default_value = roughness
    material.node_tree.links.new(surface.outputs[0], out.inputs[0])
    thing.data.materials.append(material)


def rotation_to(mathutils, normal):
    return mathutils.Vector(normal).to_track_quat("Z", "Y")


def build(bpy, mathutils, folder, picture):
    """The scene under the folder's own script."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=60)
    paint(bpy, bpy.context.object, TOLD["ground"] if picture else 1)
    pole = TOLD["pole"]
    bpy.ops.mesh.primitive_cylinder_add(vertices=64, radius=pole["radius"], depth=pole["height"], location=(0, 0, pole["height"] / 2))
    paint(bpy, bpy.context.object, TOLD["stone"] if picture else 0)
    for ball in TOLD["spheres"] if picture else []:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, radius=ball["radius"], location=ball["at"])
        bpy.ops.object.shade_smooth()
        paint(bpy, bpy.context.object, ball["colour"], ball["metal"], ball["roughness"])
    for normal in [] if picture else TOLD["walls"]:
        bpy.ops.mesh.primitive_plane_add(size=2, location=wall(normal))
        bpy.context.object.rotation_mode = "QUATERNION"
        bpy.context.object.rotation_quaternion = rotation_to(mathutils, normal)
        paint(bpy, bpy.context.object, 1)
    if not picture:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128, radius=TOLD["ball"]["radius"], location=TOLD["ball"]["at"])
        bpy.ops.object.shade_smooth()
        paint(bpy, bpy.context.object, 1, True, 0)
    script = folder / "sky.py"
    exec(compile(script.read_text(), script, "exec"), {"__file__": str(script)})
    built = bpy.context.scene
    built.render.engine = "CYCLES"
    built.cycles.use_denoising = built.cycles.use_adaptive_sampling = False
    built.cycles.max_bounces = 8 if picture else 1
    if picture:
        # what metal throws on the ground is found by few paths: none may outshine its pixel
        texels = np.array(built.world.node_tree.nodes["Environment Texture"].image.pixels[:])
        built.cycles.sample_clamp_indirect = 5 * texels.reshape(-1, 4)[:, :3].mean()
    built.view_settings.view_transform = "Raw"
    built.render.image_settings.file_format = "OPEN_EXR"
    built.render.image_settings.color_depth = "32"
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.rotation_mode = "QUATERNION"
    built.collection.objects.link(camera)
    built.camera = camera
    return built


def wall(normal):
    """Each stands in front of its own ten metres, so that none sees another."""
    return np.add(TOLD["wall_at"], np.multiply(normal, 10))


def render(bpy, built, place, width, height, samples):
    """Radiance, (height, width, 3), row 0 on top."""
    built.render.resolution_x, built.render.resolution_y, built.cycles.samples = width, height, samples
    built.render.filepath = str(place / "out.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(built.render.filepath, check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.array(image.pixels[:]).reshape(height, width, -1)[::-1, :, :3]
    bpy.data.images.remove(image)
    return pixels


def work(job_):
    bpy, mathutils = job.module("bpy"), job.module("mathutils")
    done = {"version": bpy.app.version_string, "cases": {}}
    for name, folder in job_["folders"].items():
        built = build(bpy, mathutils, folder, False)
        camera = built.camera
        camera.data.type, camera.data.ortho_scale = "ORTHO", 0.02

        def radiance(at, normal, samples):
            camera.location = np.add(at, normal)
            camera.rotation_quaternion = rotation_to(mathutils, normal)
            return render(bpy, built, job_["place"], 4, 4, samples).mean((0, 1))

        places = [radiance(at, [0, 0, 1], samples) for at, samples in zip(TOLD["places"], (1024, 256, 256))]
        walls = [radiance(wall(n), n, 256) for n in TOLD["walls"]]
        mirrors = [radiance(np.add(TOLD["ball"]["at"], np.multiply(n, TOLD["ball"]["radius"])), n, 16) for n in TOLD["mirrors"]]
        done["cases"][name] = {"places": places, "walls": walls, "walls_see_the_sun": True, "mirrors": mirrors}
    if job_["picture"]:
        built = build(bpy, mathutils, job_["picture"], True)
        told, camera = TOLD["camera"], built.camera
        camera.location = told["eye"]
        camera.rotation_quaternion = rotation_to(mathutils, np.subtract(told["eye"], told["target"]))
        camera.data.sensor_fit, camera.data.angle = "VERTICAL", math.radians(told["degrees"])
        done["pixels"] = render(bpy, built, job_["place"], *TOLD["size"], 64)
    return done


job.answer(work)
