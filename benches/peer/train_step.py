"""Times training steps of one of the graphs in PyTorch and prints one line of JSON, as the example `train_step` does.

    python benches/peer/train_step.py reference|folded PRESET LATENT_VECTORS STEPS [--threads T] [--form F] [--seed S] [--mixed]
"""

import argparse
import json
import math
import time

import torch

import sizes as presets
import training
import weights
from graphs import GRAPHS


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("graph", choices=GRAPHS)
    parser.add_argument("preset", choices=presets.PRESETS)
    parser.add_argument("latent_vectors", type=int)
    parser.add_argument("steps", type=int, help="steps that are timed, after one that is not")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--form", choices=("corrected", "reference"), default="corrected")
    parser.add_argument("--mixed", action="store_true", help="encoder and decoder under autocast to bfloat16")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)

    sizes = presets.of(arguments.preset, arguments.latent_vectors, arguments.form)
    before = status("VmRSS")
    ours = weights.draw(sizes, arguments.seed)
    graph = GRAPHS[arguments.graph](sizes, ours)
    # as many weights as ours: the reference graph has the queries and keys of its decoder besides
    parameters = sum(w.numel() for w in ours.values())
    del ours
    batches = [training.draw_batch(sizes, step) for step in range(1 + arguments.steps)]
    loss, optimiser = training.Loss(sizes, mixed=arguments.mixed), training.Optimiser(graph, sizes)
    seconds, values = [], []
    for batch in batches:
        start = time.perf_counter()
        optimiser.zero()
        total = sum(loss(graph, batch).values())
        total.backward()
        values.append(total.item())
        optimiser.step()
        seconds.append(time.perf_counter() - start)
    if not all(map(math.isfinite, values)):
        raise SystemExit(f"the loss is not finite: {values}")
    rows, columns = sizes.loss_size
    print(json.dumps({
        "program": arguments.graph, "preset": arguments.preset, "latent_vectors": sizes.latent_vectors,
        "panoramas": sizes.batch, "directions": rows * columns, "parameters": parameters,
        "threads": torch.get_num_threads(), "version": torch.__version__, "losses": values,
        "first_seconds": seconds[0], "seconds": seconds[1:], "start_bytes": before, "peak_bytes": status("VmHWM"),
    }))


def status(key):
    """Bytes of an entry of /proc/self/status."""
    with open("/proc/self/status") as file:
        line = next(line for line in file if line.startswith(key + ":"))
    return 1024 * int(line.split()[1])


if __name__ == "__main__":
    main()
