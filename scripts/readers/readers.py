"""Other programs' readers. Each gives height x width x 3 of float32, row 0 on top, or raises."""

import ctypes
import ctypes.util
import importlib.metadata
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"


class Missing(Exception):
    """The reader is not installed."""


def module(name):
    try:
        return __import__(name)
    except ImportError as error:
        raise Missing(str(error)) from error


def program(name):
    found = shutil.which(name)
    if not found:
        raise Missing(f"no program {name}")
    return found


def run(command):
    done = subprocess.run(command, capture_output=True, timeout=120)
    if done.returncode:
        raise RuntimeError(done.stderr.decode(errors="replace").strip().splitlines()[-1:])
    return done


def dumped(command):
    """The output file that a command appends to itself: width, height, pixels."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        run([*command, str(out)])
        data = out.read_bytes()
    width, height = np.frombuffer(data, "<u4", 2)
    return np.frombuffer(data, "<f4", offset=8).reshape(height, width, 3)


class OpenEXR:
    formats = {"exr"}

    def __init__(self, _):
        self.library = module("OpenEXR")
        self.version = importlib.metadata.version("OpenEXR")

    def read(self, path):
        return self.library.File(str(path)).channels()["RGB"].pixels.astype(np.float32)


class OpenImageIO:
    formats = {"exr", "hdr"}

    def __init__(self, _):
        self.library = module("OpenImageIO")
        self.version = importlib.metadata.version("OpenImageIO")

    def read(self, path):
        image = self.library.ImageBuf(str(path))
        if image.has_error:
            raise RuntimeError(image.geterror())
        return image.get_pixels(self.library.FLOAT)[..., :3]


class OpenCV:
    formats = {"exr", "hdr"}

    def __init__(self, _):
        self.library = module("cv2")
        self.version = self.library.__version__

    def read(self, path):
        image = self.library.imread(str(path), self.library.IMREAD_UNCHANGED)
        if image is None:
            raise RuntimeError("imread gives nothing")
        return image[..., 2::-1].astype(np.float32)


class Three:
    formats = {"exr", "hdr"}

    def __init__(self, folder, package):
        self.node = program("node")
        self.package = folder / "node_modules" / package
        if not self.package.is_dir():
            raise Missing(f"no package {package}")
        self.version = json.loads((self.package / "package.json").read_text())["version"]

    def read(self, path):
        return dumped([self.node, str(HERE / "three.mjs"), str(self.package), str(path)])


class FreeImage:
    formats = {"exr", "hdr"}

    def __init__(self, _):
        name = ctypes.util.find_library("freeimage")
        if not name:
            raise Missing("no library freeimage")
        self.library = ctypes.CDLL(name)
        for function in ["FreeImage_Load", "FreeImage_ConvertToRGBF", "FreeImage_GetScanLine", "FreeImage_GetVersion"]:
            getattr(self.library, function).restype = ctypes.c_void_p
        self.version = ctypes.string_at(self.library.FreeImage_GetVersion()).decode()

    def read(self, path):
        kind = {".exr": 29, ".hdr": 26}[path.suffix]
        image = self.library.FreeImage_Load(kind, str(path).encode(), 0)
        if not image:
            raise RuntimeError("FreeImage_Load gives nothing")
        image = ctypes.c_void_p(self.library.FreeImage_ConvertToRGBF(ctypes.c_void_p(image)))
        width, height = self.library.FreeImage_GetWidth(image), self.library.FreeImage_GetHeight(image)
        row = lambda y: ctypes.string_at(self.library.FreeImage_GetScanLine(image, height - 1 - y), 12 * width)
        return np.stack([np.frombuffer(row(y), "<f4").reshape(width, 3) for y in range(height)])


class Ffmpeg:
    def __init__(self, _):
        self.program = program("ffmpeg")
        names = run([self.program, "-v", "error", "-decoders"]).stdout.decode().split()
        self.formats = {name for name in ["exr", "hdr"] if name in names}
        self.version = run([self.program, "-version"]).stdout.decode().split()[2]

    def read(self, path):
        probe = ["-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "gbrpf32le", "-"]
        done = run([self.program, *probe])
        if done.stderr:
            raise RuntimeError(done.stderr.decode().strip().splitlines()[-1:])
        from check import shape

        height, width = shape(path)
        g, b, r = np.frombuffer(done.stdout, "<f4").reshape(3, height, width)
        return np.stack([r, g, b], -1)


class TinyExr:
    formats = {"exr"}

    def __init__(self, folder):
        compiler = program("g++")
        if not Path("/usr/include/tinyexr.h").is_file():
            raise Missing("no tinyexr.h")
        self.program = folder / "tiny"
        run([compiler, "-O1", "-o", str(self.program), str(HERE / "tiny.cpp"), "-ltinyexr"])
        self.version = "Debian's"

    def read(self, path):
        return dumped([str(self.program), str(path)])


READERS = {
    "three.js 0.182": lambda folder: Three(folder, "three-182"),
    "three.js newest": lambda folder: Three(folder, "three-newest"),
    "OpenEXR": OpenEXR,
    "OpenImageIO": OpenImageIO,
    "OpenCV": OpenCV,
    "FreeImage": FreeImage,
    "ffmpeg": Ffmpeg,
    "tinyexr": TinyExr,
}
