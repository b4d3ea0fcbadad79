"""What check.py asks of an engine's script, and how that answers: a JSON file each, one process per engine."""

import json
import sys
from pathlib import Path

MISSING = 3


class Missing(Exception):
    """The engine, or what it runs in, is not installed."""


def answer(work):
    """Runs `work(job)`: `job` has `engine`, `packages`, `place`, `folders` (by case) and `picture` (a folder, or None). It gives
    `version` and `cases` (by case), and `pixels` if there is to be a picture."""
    job = json.loads(Path(sys.argv[1]).read_text())
    for key in ("packages", "place", "picture"):
        job[key] = job[key] and Path(job[key])
    job["folders"] = {name: Path(folder) for name, folder in job["folders"].items()}
    try:
        done = work(job)
    except Missing as error:
        print(error)
        sys.exit(MISSING)
    (job["place"] / "answer.json").write_text(json.dumps(done, default=lambda array: array.tolist()))


def module(name):
    try:
        return __import__(name)
    except ImportError as error:
        raise Missing(f"no Python package {name} ({error})") from error
