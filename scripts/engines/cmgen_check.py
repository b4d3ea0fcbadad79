"""GGX levels of cmgen and of veni-cli on the same panorama, against a sum over all its pixels."""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import sky

FACES = [  # lookup vectors of faces +X -X +Y -Y +Z -Z at (a, b)
    lambda a, b: (1 + 0 * a, -b, -a), lambda a, b: (-1 + 0 * a, -b, a),
    lambda a, b: (a, 1 + 0 * a, b), lambda a, b: (a, -1 + 0 * a, -b),
    lambda a, b: (a, -b, 1 + 0 * a), lambda a, b: (-a, -b, -1 + 0 * a),
]


def directions(size):
    """Native directions (6, n, n, 3) of Filament's cubes, and solid angles."""
    c = (2 * np.arange(size) + 1) / size - 1
    a, b = np.meshgrid(c, c)
    v = np.stack([np.stack(f(a, b), -1) for f in FACES])
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(v / length, -1, 0)
    return np.stack([z, x, y], -1), (length[..., 0] ** -3)


def truth(image, alpha, normals):
    """The sum of radiance through the lobe over all pixels, for each normal."""
    d, w = sky.grid()
    d, l = d.reshape(-1, 3), (image * w[..., None]).reshape(-1, 3)
    t0 = np.cos((np.arange(200000) + 0.5) / 200000 * np.pi / 2)
    kernel = lambda t: np.where(t > 0, t, 0) / ((1 + t) / 2 * (alpha ** 2 - 1) + 1) ** 2
    whole = 2 * np.pi * (kernel(t0) * np.sqrt(1 - t0 ** 2)).mean() * np.pi / 2
    return np.stack([(kernel(d @ n)[:, None] * l).sum(0) / whole for n in normals])


def places(size, count):
    """Texels spread over the cube by solid angle, and around the sun."""
    d, w = directions(size)
    random = np.random.default_rng(1)
    spread = random.choice(6 * size * size, count, p=(w / w.sum()).reshape(-1))
    near = np.argsort(-(d.reshape(-1, 3) @ sky.SUN))[:8]
    return np.concatenate([spread, near]), d.reshape(-1, 3)


def run(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    binary, checks = Path(sys.argv[1]).resolve(), sky.Checks()
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        sky.write_hdr(place / "sky.hdr", sky.panorama())
        image = sky.read_hdr(place / "sky.hdr")
        _, scale = sky.folder(binary, place, "filament", "--sun", "keep")
        ours = run([binary, "ibl", place / "sky.hdr", "--engine", "filament", "-o", place / "again", "--sun", "keep", "--quiet"])
        theirs = run(["cmgen", "--deploy=" + str(place / "theirs"), "--format=ktx", "--size=256", "--ibl-samples=1024",
                      str(place / "sky.hdr")])
        peer = next((place / "theirs").rglob("*_ibl.ktx"))
        levels = {"veni": [level / scale for level in sky.ktx1(place / "filament/sky_ibl.ktx")[0]], "cmgen": sky.ktx1(peer)[0]}
        _, w0 = sky.grid()
        mean = (image * w0[..., None]).sum((0, 1)) / (4 * np.pi)
        print(f"processor seconds: veni {ours:.2f}, cmgen {theirs:.2f}")
        for level in range(1, 5):
            p = 1 - np.sqrt(1 - level / 4)
            size = 256 >> level
            at, d = places(size, 40)
            expected = truth(image, p * p, d[at])
            _, w = directions(size)
            error = {}
            for name, all_levels in levels.items():
                texels = all_levels[level].reshape(-1, 3)
                error[name] = np.sqrt(((texels[at] - expected) ** 2).sum() / (expected ** 2).sum())
                energy = (texels * w.reshape(-1, 1)).sum(0) / w.sum() / mean
                print(f"  p {p:.3f} {name:5} relative RMSE {100 * error[name]:.3f} %, energy {energy.mean():.4f}")
            # 6 bits of mantissa round to 0.45 % RMS at worst, which is the format's own
            bar = (0.003 if p >= 0.29 else 0.01) + 0.005
            checks.say(f"level {level}", error["veni"] <= bar and error["veni"] < error["cmgen"],
                       f"{100 * error['veni']:.3f} % (bar {100 * bar:.2f} %, cmgen {100 * error['cmgen']:.2f} %)")
    checks.end()


main()
