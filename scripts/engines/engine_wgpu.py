"""Example 7 of veni-gpu, a renderer on wgpu, renders the folder for any renderer."""

import json
import subprocess

import numpy as np

import job
import scene


def work(asked):
    program = asked["packages"].parent / "release/examples/7_lit_scene"
    if not program.is_file():
        raise job.Missing("not built: cargo build --release -p veni-gpu --example 7_lit_scene")

    def run(folder, *options):
        return subprocess.run([program, folder, "--json", *options], check=True, capture_output=True, text=True).stdout

    # it measures beside the pole where it is told that the sun should be
    told = scene.told("three")
    listed = lambda v: ",".join(map(str, v))
    directions = ["--sun", listed(told["places"][2])]
    for mirror in told["mirrors"]:
        directions += ["--mirror", listed(mirror)]
    done = {"version": "30", "cases": {}}
    for name, folder in asked["folders"].items():
        done["cases"][name] = {**json.loads(run(folder, *directions)), "walls_see_the_sun": False}
    if asked["picture"]:
        width, height = scene.SIZE
        raw = asked["place"] / "picture.raw"
        run(asked["picture"], "-o", asked["place"] / "picture.png", "--raw", raw, "--size", f"{width}x{height}")
        done["pixels"] = np.fromfile(raw, "<f4").reshape(height, width, 3)
    return done


job.answer(work)
