"""Mitsuba 3 renders its folder: a white diffuse plane, and a pole that throws a shadow."""

import sys
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np

import sky

mi.set_variant("scalar_rgb")


def scene(place, folder):
    """A plane at y = 0 seen from above, and a pole at the origin, in the folder's own emitters."""
    text = f"""<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="2"/></integrator>
    <path value="{folder.name}"/>
    <include filename="sky.xml"/>
    <shape type="rectangle">
        <transform name="to_world"><scale value="20"/><rotate x="1" angle="-90"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf>
    </shape>
    <shape type="cylinder">
        <point name="p0" x="0" y="0" z="0"/><point name="p1" x="0" y="2" z="0"/><float name="radius" value="0.05"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    </shape>
</scene>"""
    path = place / "scene.xml"
    path.write_text(text)
    return mi.load_file(str(path))


def radiance(scene, x, z, samples):
    """Mean radiance that the plane sends upwards at (x, z)."""
    sensor = mi.load_dict({
        "type": "radiancemeter", "origin": [x, 1.0, z], "direction": [0, -1, 0],
        "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        "sampler": {"type": "independent", "sample_count": samples},
    })
    return np.array(mi.render(scene, sensor=sensor, spp=samples)).reshape(3)


def main():
    binary, checks = Path(sys.argv[1]).resolve(), sky.Checks()
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        folder, scale = sky.folder(binary, place, "mitsuba")
        image = sky.read_hdr(place / "sky.hdr")
        built = scene(place, folder)
        expected = scale * sky.irradiance(image, [0, 0, 1]) / np.pi
        checks.within("plane in the open", radiance(built, 15.0, 15.0, 16384), expected, 0.01)
        # native (x, y, z) is Mitsuba's (z, x, y): the shadow falls away from the sun
        away = -np.array([sky.SUN[1], sky.SUN[0]]) / np.hypot(sky.SUN[0], sky.SUN[1])
        for turn, name in [(1, "away from the sun"), (-1, "towards the sun")]:
            x, z = turn * away
            share = (radiance(built, x, z, 4096) / expected).mean()
            checks.say(f"a metre from the pole, {name}", (share < 0.8) == (turn == 1), f"{share:.3f} of the open plane")
    checks.end()


main()
