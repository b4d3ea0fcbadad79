"""Whether engines agree with the folders that veni-cli makes for them.

    check.py --cli VENI-CLI --packages FOLDER [--only NAME ...] [--picture FILE.png] [--details]

One sky with a sun of its true size; each engine that is installed renders its folder of it, and two that are wrong on purpose: the sky
rotated by 90 degrees, and a sun of twice the irradiance. Prints a table; exit code 1 if an engine disagrees with its folder, or agrees
with a wrong one; 3 if none could be run.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import job
import scene
import sky

HERE = Path(__file__).resolve().parent
# name, script, the folder's engine, options of its folders, whether it makes pictures
ENGINES = [
    ("three.js", "three", "three", [], True),
    ("Babylon.js", "babylon", "babylon", [], True),
    ("Babylon.js, glTF", "babylon", "gltf", [], False),
    ("Mitsuba", "mitsuba", "mitsuba", [], True),
    ("Blender", "blender", "blender", [], True),
    ("wgpu", "wgpu", "any", [], True),
    # what cmgen does: everything in the map
    ("cmgen", "cmgen", "filament", ["--sun", "keep"], False),
]
# of all light falling on the plane; the deviation is rounding of the panorama's
HARMONICS_BAR = 0.001


def judge_levels(found, details):
    """As scene.Truth.judge, of prefiltered levels beside cmgen's."""
    faults = []
    for level in found["levels"]:
        text = "p {p:.3f}: veni {0:.2f} %, energy {energy:.4f}; cmgen {1:.2f} %, energy {their_energy:.4f}"
        text = text.format(100 * level["off"], 100 * level["theirs"], **level)
        if details:
            print("    " + text)
        if level["off"] > min(level["bar"], level["theirs"]) or abs(level["energy"] - 1) > 0.002:
            faults.append(text)
    if found["harmonics"] > HARMONICS_BAR:
        faults.append(f"harmonics are off by {100 * found['harmonics']:.2f} %")
    worst = max(level["off"] for level in found["levels"])
    return [f"levels {100 * worst:.2f} %", "-", f"nine {100 * found['harmonics']:.3f} %", "-"], faults


def ask(python, script, asked, seconds):
    """The answer of an engine's script."""
    question = Path(asked["place"]) / "job.json"
    question.write_text(json.dumps(asked, default=str))
    command = [python, HERE / f"engine_{script}.py", question]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        # a slow machine says nothing about a folder
        raise job.Missing(f"did not end within {seconds:g} s") from None
    if done.returncode == job.MISSING:
        raise job.Missing(done.stdout.strip())
    if done.returncode:
        return None, "failed: " + (done.stderr.strip() or "no reason given")[-3000:]
    return json.loads((Path(asked["place"]) / "answer.json").read_text()), None


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--cli", required=True, type=lambda p: Path(p).resolve())
    arguments.add_argument("--packages", required=True, type=lambda p: Path(p).resolve())
    arguments.add_argument("--only", nargs="*", default=[])
    arguments.add_argument("--picture", type=lambda p: Path(p).resolve())
    arguments.add_argument("--panorama", type=lambda p: Path(p).resolve(), help="another sky in the picture")
    arguments.add_argument("--details", action="store_true")
    arguments.add_argument("--seconds", type=float, default=300, help="the most that one engine may take")
    options = arguments.parse_args()
    chosen = [e for e in ENGINES if not options.only or e[0].lower() in [o.lower() for o in options.only]]
    missing, bad, ran, pictures = {}, 0, 0, {}
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder).resolve()
        sky.write_hdr(folder / "sky.hdr", sky.panorama())
        sky.write_hdr(folder / "doubled.hdr", sky.panorama(strength=2))
        truth = scene.Truth(sky.read_hdr(folder / "sky.hdr"))
        print(f"{'engine':<17} {'version':<16} {'plane':>13} {'shadow':>20} {'walls':>13} {'mirror':>8} {'wrong folders':>14} {'s':>4}")
        for name, script, engine, extra, pictured in chosen:
            started, place = time.monotonic(), folder / engine
            place.mkdir()
            cases = {"right": ("sky", []), "rotated": ("sky", ["--turn", "90"]), "doubled": ("doubled", [])}
            made = {case: sky.folder(options.cli, folder / f"{source}.hdr", place / case, engine, *more, *extra)
                    for case, (source, more) in cases.items()}
            sample = None
            if options.picture and pictured:
                source = options.panorama or folder / "sky.hdr"
                sample, _ = sky.folder(options.cli, source, place / "picture", engine)
            asked = {"engine": engine, "packages": options.packages, "place": place, "picture": sample,
                     "folders": {case: path for case, (path, _) in made.items()},
                     "scales": {case: scale for case, (_, scale) in made.items()}}
            try:
                done, failure = ask(sys.executable, script, asked, options.seconds)
            except job.Missing as error:
                missing[name] = error
                continue
            ran += 1
            if failure:
                bad += 1
                print(f"{name:<17} {failure}")
                continue
            judge = lambda case: (judge_levels(done["cases"][case], options.details and case == "right") if script == "cmgen"
                                  else truth.judge(done["cases"][case], made[case][1]))
            shown, faults = judge("right")
            caught = {case: judge(case)[1] for case in ("rotated", "doubled")}
            row = f"{sum(map(bool, caught.values()))}/2 caught"
            print(f"{name:<17} {done['version']:<16} {shown[0]:>13} {shown[1]:>20} {shown[2]:>13} {shown[3]:>8} {row:>14} "
                  f"{time.monotonic() - started:>4.0f}", flush=True)
            for fault in faults:
                print(f"    WRONG: {fault}")
            for case, found in caught.items():
                if not found:
                    print(f"    WRONG: the folder made {case} was not noticed: the check is blind")
                elif options.details:
                    print(f"    the folder made {case}: {'; '.join(found)}")
            bad += bool(faults) or not all(caught.values())
            if sample:
                pictures[f"{name} {done['version']}"] = np.array(done["pixels"])
    for name, why in missing.items():
        print(f"{name:<17} not checked: {why}")
    if pictures:
        import picture

        picture.write(options.picture, pictures)
    return 1 if bad else 0 if ran else job.MISSING


if __name__ == "__main__":
    sys.exit(main())
