"""Whether what veni writes opens elsewhere, with the same values.

    check.py --cli VENI-CLI --packages FOLDER [--only NAME ...]

Writes files with every command that writes EXR or Radiance, reads them with every reader of readers.py that is installed,
and compares each pixel with the plain decoder of reference.py. Prints a table; exit code 1 if a file does not open or a
value differs. With --only, a reader that is missing is an error too.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import reference
from readers import READERS, Missing

# RGBE: some readers put a value in the middle of its step, and three.js divides by 255 where others do by 256; of the
# brightest channel
STEP = 1 / 250
FILES = {}


def shape(path):
    return FILES[path].shape[:2]


def write(cli, folder):
    """The files, all in `folder`."""

    def veni(*args):
        subprocess.run([cli, *args, "--quiet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)

    # all vectors and no lobes: the longest headers
    for model in ["27", "vectors-147", "vectors-300"]:
        for size in ["64", "512"]:
            base = ["bake", "--seed", "7", "--model", model, "--size", size, "--device", "cpu"]
            name = f"bake-{model.removeprefix('vectors-')}-{size}"
            veni(*base, "--half", "-o", f"{name}-half.exr")
            veni(*base, "--float", "-o", f"{name}-float.exr", "-o", f"{name}.hdr")
    veni("bake", "--seed", "7", "--layout", "cubemap", "--size", "16", "-o", "cube.exr", "-o", "cube.hdr")
    veni("bake", "--seed", "7", "--size", "64", "--exposure", "-28", "-o", "dark.exr", "-o", "dark.hdr")
    light = "bake-27-64-float.exr"
    veni("render-probe", light, "--size", "64", "-o", "probe.exr", "-o", "probe.hdr", "--normals", "normals.exr")
    veni("synth", "--count", "1", "--scene", "night", "--size", "64", "-o", "synth")
    veni("prepare", "synth", "-o", "set", "--val", "0", "--size", "64")
    veni("fit", light, "--steps", "1", "-o", "fit.json", "--completed", "completed.exr")
    files = sorted(p for p in folder.rglob("*") if p.suffix in {".exr", ".hdr"})
    return [p for p in files if ".prepare" not in p.parts]


def rules(path, said):
    """What other software's limits ask of a header."""
    if path.suffix == ".hdr":
        return [f"a line of {len(line)} bytes" for line in said if len(line.encode()) > 100]
    broken = [f"{name} has {len(text)} bytes" for name, text in said.items() if len(text.encode()) > 255]
    parts = sum(name.startswith("veni:latent[") for name in said)
    if path.name.startswith("bake-300") and parts < 15:
        broken.append(f"its latent is in {parts} parts: not the long header that this check is about")
    return broken


def difference(path, image, truth):
    if image.shape != truth.shape:
        return f"{image.shape[1]} x {image.shape[0]} pixels"
    if path.suffix == ".exr":
        worst = np.abs(image - truth).max()
        return None if worst == 0 else f"off by {worst:.3g}"
    worst = (np.abs(image - truth) / np.maximum(truth.max(-1, keepdims=True), 1e-38)).max()
    return None if worst <= STEP else f"off by {worst:.3g} of the brightest channel"


def is_noticed(path, image):
    """Whether another last value would have been seen."""
    changed = FILES[path].copy()
    changed[-1, -1] *= 1.02
    changed[-1, -1, 0] += 1e-30
    return difference(path, image, changed) is not None


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--cli", required=True, type=lambda p: str(Path(p).resolve()))
    arguments.add_argument("--packages", required=True, type=lambda p: Path(p).resolve())
    arguments.add_argument("--only", nargs="*", default=[])
    options = arguments.parse_args()
    names = [n for n in READERS if not options.only or any(n.lower().startswith(o.lower()) for o in options.only)]
    readers, missing, bad = {}, {}, 0
    for name in names:
        try:
            readers[name] = READERS[name](options.packages)
        except Missing as error:
            missing[name] = error
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder).resolve()
        paths = write(options.cli, folder)
        for path in paths:
            FILES[path], said = reference.exr(path) if path.suffix == ".exr" else reference.hdr(path)
            for rule in rules(path, said):
                bad += 1
                print(f"{path.relative_to(folder)}: {rule}")
        print(f"{'reader':<20} {'version':<24} {'.exr':>7} {'.hdr':>7}")
        for name, reader in readers.items():
            counts, faults = {".exr": [0, 0], ".hdr": [0, 0]}, []
            for path in paths:
                if path.suffix[1:] not in reader.formats:
                    continue
                count = counts[path.suffix]
                count[1] += 1
                try:
                    image = reader.read(path)
                    fault = difference(path, image, FILES[path])
                    assert is_noticed(path, image), "a changed value was not noticed: the check is blind"
                except Exception as error:  # whatever a reader does with a file that it does not like
                    fault = f"{type(error).__name__}: {error}"
                count[0] += fault is None
                if fault:
                    faults.append(f"    {path.relative_to(folder)}: {fault}")
            bad += len(faults)
            shown = [f"{good}/{all}" if all else "-" for good, all in counts.values()]
            print(f"{name:<20} {reader.version:<24} {shown[0]:>7} {shown[1]:>7}")
            print(*faults, sep="\n", end="\n" if faults else "")
    for name, why in missing.items():
        print(f"{name:<20} not installed: {why}")
    if missing and options.only:
        bad += 1
    return 1 if bad or not readers else 0


if __name__ == "__main__":
    sys.modules["check"] = sys.modules["__main__"]
    sys.exit(main())
