"""A training step of ours beside the same step in plain PyTorch: the reference graph and the folded one.

    python benches/peer/measure.py --veni target/release/examples/train_step --pairs 5 --threads 2
    python benches/peer/measure.py --veni target/release/examples/train_step --check

In each pair the three programs run one after the other, each in a process of its own, on the same cores. A program takes
one step that is not timed and then some that are; its time is their median. Ratios are formed within a pair.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
DATA = HERE.parents[1] / "assets" / "panoramas"
CASES = ["paper:9", "paper:100", "small:9"]
PROGRAMS = ("ours", "reference", "folded")
# With --mixed instead of the reference graph, each program in f32 and with products in bfloat16
MIXED = ("ours", "ours-mixed", "folded", "folded-mixed")
# What our losses and VN-ReLUs are called in the reference form
REFERENCE = [
    "loss.form=reference", "loss.exposure=0.0", "model.encoder.vn_relu=reference", "model.decoder.vn_relu=reference",
]
# glibc gives large blocks back to the system and gets them page by page; ours does not use glibc's allocator
ALLOCATOR = {"MALLOC_MMAP_MAX_": "0", "MALLOC_TRIM_THRESHOLD_": str(1 << 34), "MALLOC_TOP_PAD_": str(1 << 28)}
# What `veni-cli train` sets for itself
KEEP = {"MIMALLOC_PURGE_DELAY": "-1"}
# Numbers on which the three programs must agree
SAME = ("preset", "latent_vectors", "panoramas", "directions", "parameters")


def command(program, preset, latent_vectors, options, record=None):
    if program.startswith("ours"):
        mixed = ["decoder_backend=kernels-bfloat16"] if program == "ours-mixed" else []
        extra = (["--record", record] if record else []) + mixed + (REFERENCE if options.form == "reference" else [])
        return [options.veni, str(DATA), preset, latent_vectors, str(options.steps), *extra]
    graph, _, mixed = program.partition("-")
    script = [sys.executable, str(HERE / "train_step.py"), *(["--mixed"] if mixed else []), graph, preset, latent_vectors, str(options.steps)]
    return [*script, "--threads", str(options.threads), "--form", options.form]


def environment(program, options):
    threads = {name: str(options.threads) for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}
    tuned = {} if options.allocator != "tuned" else KEEP if program.startswith("ours") else ALLOCATOR
    return {**os.environ, **threads, **tuned}


def run(program, preset, latent_vectors, options, record=None):
    """What the program says about its steps."""
    cores = sorted(os.sched_getaffinity(0))[: options.threads]
    result = subprocess.run(
        command(program, preset, latent_vectors, options, record), env=environment(program, options), text=True,
        stdout=subprocess.PIPE, preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )
    if result.returncode:
        raise SystemExit(f"{' '.join(result.args)}: exit code {result.returncode}")
    said = json.loads(result.stdout.splitlines()[-1])
    said["program"] = program
    said["step_seconds"] = statistics.median(said["seconds"])
    return said


def measure(case, options):
    """All runs of a case: a dictionary by program for every pair."""
    preset, latent_vectors = case.split(":")
    pairs = []
    for pair in range(options.pairs):
        found = {}
        for program in options.programs:
            found[program] = said = run(program, preset, latent_vectors, options)
            print(f"{case} pair {pair + 1}: {program} {said['step_seconds']:.3f} s", file=sys.stderr, flush=True)
        for key in SAME:
            values = {program: found[program][key] for program in options.programs}
            if len({str(v) for v in values.values()}) > 1:
                raise SystemExit(f"{case}: the programs do not do the same: {key} is {values}")
        pairs.append(found)
    return pairs


def spread(values):
    return {"min": min(values), "median": statistics.median(values), "max": max(values)}


def summary(case, pairs):
    any_pair = pairs[0]["ours"]
    found = {"case": case, **{key: any_pair[key] for key in SAME}, "programs": {}, "ratios": {}}
    for program in pairs[0]:
        runs = [pair[program] for pair in pairs]
        found["programs"][program] = {
            "step_seconds": spread([r["step_seconds"] for r in runs]),
            "peak_bytes": spread([r["peak_bytes"] for r in runs]),
            "start_bytes": spread([r["start_bytes"] for r in runs]),
        }
    for program in list(pairs[0])[1:]:
        found["ratios"][program] = spread([p[program]["step_seconds"] / p["ours"]["step_seconds"] for p in pairs])
    return found


NAMES = {"ours": "veni", "reference": "PyTorch, the reference graph", "folded": "PyTorch, folded graph"}
NAMES |= {"ours-mixed": "veni, bfloat16 in the decoder", "folded-mixed": "PyTorch, folded graph, autocast to bfloat16"}


def markdown(summaries, options, version):
    """Tables for docs/RESULTS.md."""
    lines = [
        f"{options.pairs} pairs, {options.threads} threads, PyTorch {version}, form {options.form}, allocator of PyTorch "
        f"{options.allocator}, a run's time is the median of {options.steps} steps; min / median / max over pairs.", "",
        "| | seconds per step | per panorama | times ours | peak memory (of it the program as it starts) |",
        "|---|---|---|---|---|",
    ]
    for found in summaries:
        n, panoramas = found["latent_vectors"], found["panoramas"]
        batch = f"{panoramas} panoramas, {found['directions']} directions each"
        lines.append(f"| **{found['preset']}, D = {3 * n}, {batch}** | | | | |")
        for program, numbers in found["programs"].items():
            s, peak, start = numbers["step_seconds"], numbers["peak_bytes"], numbers["start_bytes"]
            ratio = found["ratios"].get(program)
            lines.append(
                f"| {NAMES[program]} | {three(s)} | {s['median'] / panoramas:.3f} | {three(ratio) if ratio else '1'} | "
                f"{peak['max'] / 1e9:.2f} GB ({start['max'] / 1e9:.2f}) |"
            )
    return "\n".join(lines)


def three(values):
    return " / ".join(f"{values[k]:.2f}" for k in ("min", "median", "max"))


def checked(options):
    """The graphs against each other, the numbers of the reference implementation, and a step of ours."""
    import check

    with tempfile.TemporaryDirectory() as folder:
        records = []
        for preset in ("tiny", "small", "paper"):
            path = str(Path(folder) / f"{preset}.safetensors")
            run("ours", preset, "9", options, record=path)
            records.append((preset, path))
        return check.run(options.veni_cli, records)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--veni", required=True, metavar="BINARY", help="the example train_step, built in release mode")
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--steps", type=int, default=3, help="timed steps of a run")
    parser.add_argument("--cases", nargs="+", default=CASES, metavar="PRESET:N", help=f"default: {' '.join(CASES)}")
    parser.add_argument(
        "--form", choices=("corrected", "reference"), default="corrected",
        help="losses and VN-ReLUs as ours has them by default, or as the reference implementation has them; in all three alike",
    )
    parser.add_argument(
        "--allocator", choices=("tuned", "plain"), default="tuned",
        help="PyTorch's memory: glibc told to keep large blocks (quicker), or as it is",
    )
    parser.add_argument(
        "--mixed", action="store_true",
        help="each program in f32 and with products in bfloat16 (processors with AVX512-BF16), without the reference graph",
    )
    parser.add_argument("--json", action="store_true", help="print everything as JSON instead of tables")
    parser.add_argument("--check", action="store_true", help="compare numbers instead of times; exit code 1 if they differ")
    parser.add_argument("--veni-cli", metavar="BINARY", help="with --check: compare with what it bakes, too")
    options = parser.parse_args()
    options.programs = MIXED if options.mixed else PROGRAMS
    if options.check:
        options.steps = 1
        sys.exit(0 if checked(options) else 1)
    results = {case: measure(case, options) for case in options.cases}
    summaries = [summary(case, pairs) for case, pairs in results.items()]
    version = next(iter(results.values()))[0]["folded"]["version"]
    if options.json:
        settings = {k: getattr(options, k) for k in ("pairs", "threads", "steps", "form", "allocator")}
        print(json.dumps({"settings": settings, "pytorch": version, "summaries": summaries, "pairs": results}))
    else:
        print(markdown(summaries, options, version))


if __name__ == "__main__":
    main()
