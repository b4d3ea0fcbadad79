"""The scene that every engine builds, in native axes (z up, the centre of the panorama at +x), and what is right about its light.

Measured: a white diffuse plane at z = 0 in the open and on both sides of a pole at the origin; far from both, white walls, and a mirror
ball, which tells how every face of a cube map lies.
Pictured: the same plane in grey, the pole, a white sphere and a rough metal one.
"""

import numpy as np

import sky

POLE = {"radius": 0.1, "height": 2.0}
TOWARDS = sky.SUN[:2] / np.hypot(*sky.SUN[:2])
# in the open, a metre from the pole away from the sun, a metre from the pole towards the sun
PLACES = np.array([[12.0, 12.0, 0.0], [*-TOWARDS, 0.0], [*TOWARDS, 0.0]])
# so far away that plane and pole are nothing
WALL_AT = np.array([1000.0, 1000.0, 500.0])
# the ball seen along its own normals shows the sky in that direction: above and below the horizon, beside the sun and where it would be
# if a face were mirrored
BALL = {"at": [-1000.0, 1000.0, 500.0], "radius": 20.0}
MIRRORS = np.array([[np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)] for a, e in np.radians(
    [(-60, 40), (-120, 40), (-38, 45), (30, 25), (140, 25), (-60, -40), (60, -25), (170, -30), (0, 75), (-140, 75)])])
SPHERES = [
    {"at": [0.2, -1.5, 0.6], "radius": 0.6, "colour": 0.8, "metal": False, "roughness": 1.0},
    {"at": [0.6, 1.4, 0.6], "radius": 0.6, "colour": 0.9, "metal": True, "roughness": 0.3},
]
CAMERA = {"eye": [-6.2, 0.6, 2.1], "target": [0.0, 0.0, 0.75], "degrees": 34.0}  # vertically
GROUND, STONE = 0.5, 0.8
SIZE = (360, 270)

# rows give the engine's x, y, z of a native vector
FRAMES = {
    "blender": np.eye(3),
    "mitsuba": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "three": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "babylon": np.array([[0, -1, 0], [0, 0, 1], [1, 0, 0]]),
    # the loader's world is (−x, y, z) of glTF's (x, z, −y)
    "gltf": np.array([[-1, 0, 0], [0, 0, 1], [0, -1, 0]]),
}


def told(engine):
    """Everything above in the engine's frame, as JSON takes it."""
    in_frame = lambda v: (np.asarray(v, float) @ FRAMES[engine].T).tolist()
    return {
        "pole": POLE, "places": in_frame(PLACES), "walls": in_frame(sky.WALLS), "wall_at": in_frame(WALL_AT),
        "ball": {**BALL, "at": in_frame(BALL["at"])}, "mirrors": in_frame(MIRRORS),
        "spheres": [{**s, "at": in_frame(s["at"])} for s in SPHERES],
        "camera": {**CAMERA, "eye": in_frame(CAMERA["eye"]), "target": in_frame(CAMERA["target"])},
        "ground": GROUND, "stone": STONE, "size": SIZE,
    }


PLANE_BAR = 0.01
# nine harmonics miss a few percent of a dark ground; a quarter turn or a mirror image miss a fifth
WALL_BAR = 0.08
# texels, the halves of 8-bit formats, and engines' fits of what a mirror reflects
MIRROR_BAR = 0.05


class Truth:
    """Radiance of plane and walls by sums over the panorama's pixels, in the panorama's unit."""

    def __init__(self, image):
        up, rest = np.array([0, 0, 1]), sky.panorama(sun=False)
        self.plane = sky.irradiance(image, up) / np.pi
        self.walls = {True: np.array([sky.irradiance(image, n) for n in sky.WALLS]) / np.pi,
                      False: np.array([sky.irradiance(rest, n) for n in sky.WALLS]) / np.pi}
        row, column = np.arccos(MIRRORS[:, 2]) / np.pi, 0.5 - np.arctan2(MIRRORS[:, 1], MIRRORS[:, 0]) / (2 * np.pi)
        self.mirrors = rest[(row * sky.HEIGHT).astype(int), (column * sky.WIDTH).astype(int)]
        for walls in self.walls.values():
            for other in (walls[[1, 2, 3, 0]], walls[[0, 3, 2, 1]], walls[[2, 1, 0, 3]]):
                assert np.abs(other / walls - 1).max() > 1.5 * WALL_BAR, "walls do not tell a rotated or mirrored map"

    def judge(self, found, scale):
        """What is shown of a measurement, and what is wrong with it."""
        plane, behind, before = np.array(found["places"]) / (scale * self.plane)
        walls = np.array(found["walls"]) / (scale * self.walls[found["walls_see_the_sun"]])
        mirrors = np.array(found["mirrors"]) / (scale * self.mirrors)
        off, rotated, seen = (np.abs(share - 1).max() for share in (plane, walls, mirrors))
        faults = []
        if off > PLANE_BAR:
            faults.append(f"the plane is off by {100 * off:.2f} %")
        if not behind.mean() < 0.8 < before.mean():
            faults.append(f"beside the pole there is {behind.mean():.2f} of the light away from the sun, {before.mean():.2f} towards it")
        if rotated > WALL_BAR:
            faults.append(f"walls are off by {100 * rotated:.1f} %")
        if seen > MIRROR_BAR:
            faults.append(f"the mirror is off by {100 * seen:.1f} %")
        side = "right" if behind.mean() < 0.8 < before.mean() else "WRONG"
        shown = [f"{100 * off:.3f} %", f"{side} ({behind.mean():.2f}, {before.mean():.2f})", f"{100 * rotated:.2f} %", f"{100 * seen:.2f} %"]
        return shown, faults
