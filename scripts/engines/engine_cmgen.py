"""GGX levels and harmonics of cmgen and of our Filament folder on the same panorama, against a sum over all its pixels."""

import shutil
import subprocess

import numpy as np

import job
import sky

FACES = [  # lookup vectors of faces +X -X +Y -Y +Z -Z at (a, b)
    lambda a, b: (1 + 0 * a, -b, -a), lambda a, b: (-1 + 0 * a, -b, a),
    lambda a, b: (a, 1 + 0 * a, b), lambda a, b: (a, -1 + 0 * a, -b),
    lambda a, b: (a, -b, 1 + 0 * a), lambda a, b: (-a, -b, -1 + 0 * a),
]
# 6 bits of mantissa round to 0.45 % RMS at worst, which is the format's own
ROUNDING = 0.005


def directions(size):
    """Native directions (6, n, n, 3) of Filament's cubes, and solid angles."""
    c = (2 * np.arange(size) + 1) / size - 1
    a, b = np.meshgrid(c, c)
    v = np.stack([np.stack(f(a, b), -1) for f in FACES])
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(v / length, -1, 0)
    return np.stack([z, x, y], -1), (length[..., 0] ** -3)


class Truth:
    """Sums over all pixels."""

    def __init__(self, image):
        d, w = sky.grid()
        self.d, self.l = d.reshape(-1, 3).astype(np.float32), (image * w[..., None]).reshape(-1, 3)
        self.mean = self.l.sum(0) / (4 * np.pi)

    def through(self, alpha, normals):
        """The lobe's mean of radiance about each normal."""
        kernel = lambda t: np.maximum(t, 0) / ((1 + t) / 2 * (alpha ** 2 - 1) + 1) ** 2
        t = np.cos((np.arange(200000) + 0.5) / 200000 * np.pi / 2)
        whole = 2 * np.pi * (kernel(t) * np.sqrt(1 - t ** 2)).mean() * np.pi / 2
        return np.stack([kernel(self.d @ n.astype(np.float32)).astype(np.float64) @ self.l for n in normals]) / whole

    def harmonics(self):
        """The nine numbers of Filament's shaders: a polynomial of E / π in its frame."""
        y, z, x = self.d.T.astype(np.float64)[[1, 2, 0]]
        # its x is native y, its y native z, its z native x
        x, y, z = y, z, x
        basis = np.stack([1 + 0 * x, y, z, x, x * y, y * z, 3 * z * z - 1, z * x, x * x - y * y])
        squares = np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi)
        bands = np.array([1, *[2 / 3] * 3, *[1 / 4] * 5])
        return (squares * bands)[:, None] * (basis @ self.l)


def places(size, count):
    """Texels spread over the cube by solid angle, and around the sun."""
    d, w = directions(size)
    random = np.random.default_rng(1)
    spread = random.choice(6 * size * size, count, p=(w / w.sum()).reshape(-1))
    near = np.argsort(-(d.reshape(-1, 3) @ sky.SUN))[:8]
    return np.concatenate([spread, near]), d.reshape(-1, 3)


def energy(level, mean):
    _, w = directions(len(level[0]))
    return float(((level * w[..., None]).sum((0, 1, 2)) / w.sum() / mean).mean())


def work(asked):
    if not shutil.which("cmgen"):
        raise job.Missing("no program cmgen (Debian: libfilament-tools)")
    panorama, target = asked["place"].parent / "sky.hdr", asked["place"] / "cmgen"
    subprocess.run(["cmgen", f"--deploy={target}", "--format=ktx", "--size=256", "--ibl-samples=1024", panorama],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    peer, _ = sky.ktx1(next(target.rglob("*_ibl.ktx")))
    truth, done = Truth(sky.read_hdr(panorama)), {}
    expected = {}
    for level in range(1, 5):
        p = 1 - np.sqrt(1 - level / 4)
        at, d = places(256 >> level, 24)
        expected[level] = (p, at, truth.through(p * p, d[at]))
    nine = truth.harmonics()
    off = lambda level, at, right: np.sqrt(((level.reshape(-1, 3)[at] - right) ** 2).sum() / (right ** 2).sum())
    for name, folder in asked["folders"].items():
        ours, texts = sky.ktx1(folder / "sky_ibl.ktx")
        levels = []
        for level, (p, at, right) in expected.items():
            found, theirs = ours[level] / asked["scales"][name], peer[level]
            levels.append({"p": p, "off": off(found, at, right), "theirs": off(theirs, at, right),
                           "bar": (0.003 if p >= 0.29 else 0.01) + ROUNDING,
                           "energy": energy(found, truth.mean), "their_energy": energy(theirs, truth.mean)})
        sh = np.array([line.split() for line in texts["sh"].splitlines()], float) / asked["scales"][name]
        done[name] = {"levels": levels, "harmonics": float(np.abs(sh - nine).max() / np.abs(nine[0]).max())}
    return {"version": version(), "cases": done}


def version():
    said = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "libfilament-tools"], capture_output=True, text=True)
    return said.stdout.split("+")[0] or "?"


job.answer(work)
