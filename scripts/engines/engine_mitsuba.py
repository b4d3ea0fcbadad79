"""Mitsuba 3 renders its folder."""

import numpy as np

import job
import scene

TOLD = scene.told("mitsuba")


def build(mi, place, folder, picture):
    """The folder's own emitters over the scene; white and without indirect light, or as in the picture."""
    diffuse = '<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>'
    lines = [f'<integrator type="path"><integer name="max_depth" value="{8 if picture else 2}"/></integrator>',
             f'<path value="{folder}"/><include filename="sky.xml"/>',
             '<shape type="rectangle"><transform name="to_world"><scale value="30"/><rotate x="1" angle="-90"/></transform>',
             diffuse.format(TOLD["ground"] if picture else 1), "</shape>",
             f'<shape type="cylinder"><point name="p1" x="0" y="{TOLD["pole"]["height"]}" z="0"/>'
             f'<float name="radius" value="{TOLD["pole"]["radius"]}"/>', diffuse.format(TOLD["stone"] if picture else 0), "</shape>"]
    for ball in TOLD["spheres"] if picture else []:
        x, y, z = ball["at"]
        metal = (f'<bsdf type="roughconductor"><string name="material" value="none"/><string name="distribution" value="ggx"/>'
                 f'<float name="alpha" value="{ball["roughness"] ** 2}"/><rgb name="specular_reflectance" value="{ball["colour"]}"/></bsdf>')
        lines.append(f'<shape type="sphere"><point name="center" x="{x}" y="{y}" z="{z}"/><float name="radius" value="{ball["radius"]}"/>'
                     f'{metal if ball["metal"] else diffuse.format(ball["colour"])}</shape>')
    for normal in [] if picture else TOLD["walls"]:
        at, to = (", ".join(map(str, v)) for v in (wall(normal), np.add(wall(normal), normal)))
        lines.append(f'<shape type="rectangle"><transform name="to_world"><lookat origin="{at}" target="{to}" up="0, 1, 0"/></transform>'
                     f'{diffuse.format(1)}</shape>')
    if not picture:
        x, y, z = TOLD["ball"]["at"]
        lines.append(f'<shape type="sphere"><point name="center" x="{x}" y="{y}" z="{z}"/><float name="radius" value="{TOLD["ball"]["radius"]}"/>'
                     '<bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>')
    path = place / "scene.xml"
    path.write_text('<scene version="3.0.0">' + "\n".join(lines) + "</scene>")
    return mi.load_file(str(path))


def wall(normal):
    """Each stands in front of its own ten metres, so that none sees another."""
    return np.add(TOLD["wall_at"], np.multiply(normal, 10))


def radiance(mi, built, at, normal, samples):
    """Mean radiance that the surface at `at` sends along its normal."""
    sensor = mi.load_dict({
        "type": "radiancemeter", "origin": np.add(at, normal).tolist(), "direction": np.negative(normal).tolist(),
        "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        "sampler": {"type": "multijitter", "sample_count": samples},
    })
    return np.array(mi.render(built, sensor=sensor, spp=samples), float).reshape(3)


def picture(mi, built):
    camera, (width, height) = TOLD["camera"], TOLD["size"]
    sensor = mi.load_dict({
        "type": "perspective", "fov": camera["degrees"], "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at(origin=camera["eye"], target=camera["target"], up=[0, 1, 0]),
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        "sampler": {"type": "multijitter", "sample_count": 16},
    })
    # what metal throws on the ground is found by few paths: none may outshine its pixel
    passes = [np.array(mi.render(built, sensor=sensor, spp=16, seed=seed), float) for seed in range(12)]
    return np.mean([np.minimum(p, np.median(p) * 3) for p in passes], 0)


def work(job_):
    mi = job.module("mitsuba")
    mi.set_variant("scalar_rgb")
    done = {"version": mi.__version__, "cases": {}}
    for name, folder in job_["folders"].items():
        built = build(mi, job_["place"], folder, False)
        up = [0, 1, 0]
        places = [radiance(mi, built, at, up, samples) for at, samples in zip(TOLD["places"], (16384, 1024, 1024))]
        walls = [radiance(mi, built, wall(n), n, 1024) for n in TOLD["walls"]]
        mirrors = [radiance(mi, built, np.add(TOLD["ball"]["at"], np.multiply(n, TOLD["ball"]["radius"])), n, 16) for n in TOLD["mirrors"]]
        done["cases"][name] = {"places": places, "walls": walls, "walls_see_the_sun": True, "mirrors": mirrors}
    if job_["picture"]:
        done["pixels"] = picture(mi, build(mi, job_["place"], job_["picture"], True))
    return done


job.answer(work)
