"""The sky that engines are checked with, its sums, and the folder that veni-cli makes of it."""

import json
import struct
import subprocess
from pathlib import Path

import numpy as np

WIDTH, HEIGHT = 2048, 1024
# direction, angular radius and irradiance at normal incidence of the sun, native axes (z up, the centre of the panorama at +x)
SUN = np.array([0.48, -0.6, 0.64])
RADIUS = np.radians(0.2665)
IRRADIANCE = np.array([6.0, 5.0, 4.0])


def grid():
    """Directions (H, W, 3) and solid angles (H, 1) of the pixels."""
    theta = np.pi * (np.arange(HEIGHT) + 0.5) / HEIGHT
    phi = np.pi - 2 * np.pi * (np.arange(WIDTH) + 0.5) / WIDTH
    t, p = np.meshgrid(theta, phi, indexing="ij")
    directions = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1)
    edges = np.cos(np.pi * np.arange(HEIGHT + 1) / HEIGHT)
    return directions, (2 * np.pi / WIDTH * (edges[:-1] - edges[1:]))[:, None]


def panorama(sun=True, strength=1):
    """Radiance (H, W, 3): a gradient with a glow around the sun, a dark ground, and the sun's disc on the pixels it covers, so many
    times as strong."""
    d, w = grid()
    z = d[..., 2:]
    t = (d @ SUN)[..., None]
    sky = np.array([0.5, 0.7, 1.0]) + np.array([0.0, 0.2, 0.4]) * z + np.array([1.0, 0.9, 0.7]) * np.exp(40 * (t - 1)) * 3
    image = np.where(z < 0, np.array([0.12, 0.1, 0.08]), sky)
    if not sun:
        return image
    # coverage of pixels near the sun by 16 x 16 places each
    cover = np.zeros((HEIGHT, WIDTH))
    n = 16
    for j, i in np.argwhere(t[..., 0] > np.cos(RADIUS + 0.01)):
        a = (np.arange(n) + 0.5) / n
        th, ph = np.meshgrid(np.pi * (j + a) / HEIGHT, np.pi - 2 * np.pi * (i + a) / WIDTH, indexing="ij")
        dot = np.sin(th) * np.cos(ph) * SUN[0] + np.sin(th) * np.sin(ph) * SUN[1] + np.cos(th) * SUN[2]
        cover[j, i] = (dot > np.cos(RADIUS)).mean()
    image = image + cover[..., None] * (strength * IRRADIANCE) / (cover * w).sum()
    return image.astype(np.float32)


def irradiance(image, normal):
    """Of a plane with this native normal."""
    d, w = grid()
    return ((np.maximum(d @ np.asarray(normal, float), 0) * w)[..., None] * image).sum((0, 1), dtype=np.float64)


def write_hdr(path, image):
    """Radiance RGBE without run lengths."""
    largest = image.max(-1)
    exponent = np.where(largest > 0, np.floor(np.log2(np.maximum(largest, 1e-30))) + 1, 0)
    mantissa = np.clip(np.floor(image / np.exp2(exponent)[..., None] * 256 + 0.5), 0, 255)
    rgbe = np.concatenate([mantissa, (exponent + 128)[..., None]], -1).astype(np.uint8)
    with open(path, "wb") as file:
        file.write(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n".encode())
        file.write(rgbe.tobytes())


def read_hdr(path):
    """What write_hdr wrote: the sums are of what the file holds."""
    data = Path(path).read_bytes()
    rgbe = np.frombuffer(data[-WIDTH * HEIGHT * 4:], np.uint8).reshape(HEIGHT, WIDTH, 4).astype(np.float64)
    # a reader takes the middle of no interval: mantissa / 256 times the power of two
    return rgbe[..., :3] * np.exp2(rgbe[..., 3:] - 136)


def folder(binary, panorama, target, engine, *options):
    """The engine's folder, freshly made, and what radiance in it was multiplied by."""
    run = subprocess.run([binary, "ibl", panorama, "--engine", engine, "-o", target, "--quiet", "--json", *options],
                         check=True, capture_output=True, text=True)
    return target, json.loads(run.stdout)["radiance_scale"]


def ktx1(path):
    """Levels of a KTX1 cube of R11F_G11F_B10F, each (6, n, n, 3), and its texts."""
    data = Path(path).read_bytes()
    head = struct.unpack_from("<13I", data, 12)
    assert head[4] == 0x8C3A, "R11F_G11F_B10F"
    at, end, texts = 64, 64 + head[12], {}
    while at < end:
        (size,) = struct.unpack_from("<I", data, at)
        key, value = data[at + 4:at + 4 + size].split(b"\0", 1)
        texts[key.decode()] = value.rstrip(b"\0").decode(errors="replace")
        at += 4 + (size + 3) // 4 * 4
    levels, n = [], head[6]
    for _ in range(head[11]):
        (size,) = struct.unpack_from("<I", data, at)
        at += 4
        faces = np.frombuffer(data, np.uint32, 6 * n * n, at).reshape(6, n, n)
        at += 6 * size
        levels.append(np.stack([small(faces & 2047, 6), small(faces >> 11 & 2047, 6), small(faces >> 22, 5)], -1))
        n = max(n // 2, 1)
    return levels, texts


def small(bits, mantissa):
    """Floats with five bits of exponent."""
    exponent, fraction = (bits >> mantissa).astype(np.float64), (bits & ((1 << mantissa) - 1)) / (1 << mantissa)
    return np.where(exponent == 0, fraction * 2.0 ** -14, (1 + fraction) * np.exp2(exponent - 15))


# walls by their native normals: they tell how a map is rotated, and whether it is mirrored
WALLS = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], float)
