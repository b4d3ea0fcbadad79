"""How far other software looks beside a panorama whose samples are at the centres of pixels, with and without the EXR
attribute `envmap = latlong`, by which OpenEXR means samples on the edges of the image (docs/DECISIONS.md, "No `envmap`").

    envmap.py VENI-CLI       Python packages as in requirements.txt; exrenvmap (Debian: openexr) if it is there
"""

import itertools
import math
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO as oiio


def centres(width):
    """Latitude and longitude of pixel centres, y up, longitude 0 in the middle."""
    row, column = np.mgrid[0 : width // 2, 0:width]
    return math.pi / 2 - 2 * math.pi * (row + 0.5) / width, math.pi - 2 * math.pi * (column + 0.5) / width


def directions(latitude, longitude):
    across = np.cos(latitude)
    return np.stack([across * np.sin(longitude), np.sin(latitude), across * np.cos(longitude)], -1)


def write(path, pixels, envmap):
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float")
    if envmap:
        spec.attribute("textureformat", "LatLong Environment")
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image(pixels) and out.close()


def looked_up(path, pixels):
    """The largest and the mean error of OpenImageIO's environment lookup at pixel centres, of the brightest channel."""
    system, options = oiio.TextureSystem(), oiio.TextureOpt()
    options.interpmode, options.mipmode = oiio.InterpMode.Bilinear, oiio.MipMode.NoMIP
    height, width, _ = pixels.shape
    d = directions(*centres(width))
    errors = []
    for y, x in itertools.product(range(0, height, height // 16), range(0, width, width // 32)):
        got = system.environment(str(path), options, tuple(map(float, d[y, x])), (0.0,) * 3, (0.0,) * 3, 3)
        errors.append(np.abs(np.array(got) - pixels[y, x]).max() / pixels[y, x].max())
    return f"mean {np.mean(errors):.2g}, largest {np.max(errors):.2g}"


def on_a_cube(path, folder, width):
    """The mean angle between what exrenvmap puts on its face +X and what belongs there, in pixels of the panorama."""
    edge, cube = width // 2, folder / "cube.exr"
    subprocess.run(["exrenvmap", "-c", "-w", str(edge), "-f", "1", "1", "-z", "none", path, cube], check=True)
    face = OpenEXR.File(str(cube)).channels()
    face = (face["RGB"] if "RGB" in face else face["RGBA"]).pixels[:edge, :, :3].astype(float) - 2
    row, column = np.mgrid[0:edge, 0:edge] * 2 / (edge - 1) - 1
    truth = np.stack([np.ones_like(row), -row, column], -1)
    cosine = (face * truth).sum(-1) / np.linalg.norm(face, axis=-1) / np.linalg.norm(truth, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() / (360 / width)


def main(cli):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for width in [64, 1024]:
            sky = folder / f"sky-{width}.exr"
            bake = [cli, "bake", "--seed", "7", "--size", str(width), "--float", "--quiet", "-o", sky]
            subprocess.run(bake, check=True, stdout=subprocess.DEVNULL)
            pixels = OpenEXR.File(str(sky)).channels()["RGB"].pixels
            for envmap in [True, False]:
                path = folder / f"{width}-{envmap}.exr"
                write(path, pixels, envmap)
                name = "with envmap" if envmap else "without"
                print(f"OpenImageIO, {width} x {width // 2}, {name}: error {looked_up(path, pixels)}")
        if not shutil.which("exrenvmap"):
            return print("exrenvmap is not installed")
        for width in [64, 256, 1024]:
            # the direction itself as a colour, moved into positive numbers
            path = folder / "directions.exr"
            write(path, (directions(*centres(width)) + 2).astype(np.float32), True)
            print(f"exrenvmap, {width} x {width // 2}: off by {on_a_cube(path, folder, width):.2f} pixels on average")


if __name__ == "__main__":
    main(str(Path(sys.argv[1]).resolve()))
