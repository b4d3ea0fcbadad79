"""Shows that both graphs compute what this project and the reference implementation compute, before anything is timed.

    python benches/peer/check.py [--veni-cli BINARY] [--record PRESET FILE]

1. The graphs agree with each other: losses and the gradient of every weight, in f64 and f32, in both forms, with the
   weights of the shipped model.
2. The graphs agree with the recorded numbers of the reference implementation (tests/golden): encoder, decoder, losses, three training steps.
3. `--veni-cli`: the decoder agrees with what `veni-cli bake` writes.
4. `--record`: losses and gradients agree with those of a step of ours, as the example `train_step` wrote them.
5. Deliberate breaks are seen.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import torch

import exr
import golden
import sizes as presets
import training
import weights
from graphs import GRAPHS
from report import Report, difference

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "crates" / "veni-light" / "assets" / "veni-27.safetensors"
F64 = torch.float64


def model_sizes(path, form="corrected"):
    """Weights of a model file, and the preset's sizes that fit them."""
    tensors, metadata = weights.read(path)
    config = json.loads(metadata["veni"])["config"]
    encoder, decoder = config["encoder"], config["decoder"]
    found = replace(
        presets.SMALL, batch=2, width=64, height=32, latent_vectors=config["latent_vectors"],
        **{k: encoder[k] for k in ("stripes", "samples", "channels", "depth", "heads", "head_channels")},
        expansion=encoder["feedforward"], hidden=decoder["hidden"], layers=decoder["layers"], decoder_heads=decoder["heads"],
    )
    tensors = {name: w for name, w in tensors.items() if not name.startswith("prior.")}
    return tensors, found if form == "corrected" else found.reference()


def step(graph, sizes, batch, kind):
    """Weighted losses by name, and the gradients of their sum by our names."""
    terms = training.Loss(sizes, kind)(graph, batch.to(kind))
    sum(terms.values()).backward()
    return {name: value.detach() for name, value in terms.items()}, graph.gradients()


def each_other(report):
    for form in ("corrected", "reference"):
        ours, sizes = model_sizes(MODEL, form)
        batch = training.draw_batch(sizes)
        found = {}
        for name, graph in GRAPHS.items():
            for kind in (F64, torch.float32):
                found[name, kind] = step(graph(sizes, ours, kind), sizes, batch, kind)
        exact = found["folded", F64]
        for part, index in (("losses", 0), ("gradients", 1)):
            error = difference(found["reference", F64][index], exact[index])
            report.within(f"{form}, f64: {part} of the reference graph and of the folded", error, 1e-9)
            for name in GRAPHS:
                error = difference(found[name, torch.float32][index], exact[index])
                report.within(f"{form}: {part} of the graph {name} in f32 and in f64", error, 1e-3 if index else 1e-4)
    # breaks: a weight, and the form
    bent = {**ours, "encoder.cls": ours["encoder.cls"] + 1e-3}
    error = difference(step(GRAPHS["reference"](sizes, bent, F64), sizes, batch, F64)[0], exact[0])
    report.beyond("a class token that is 0.001 off", error, 1e-9)
    other = model_sizes(MODEL)[1]
    error = difference(step(GRAPHS["reference"](replace(sizes, form=other.form), ours, F64), sizes, batch, F64)[0], exact[0])
    report.beyond("VN-ReLUs of the other form", error, 1e-9)


def baked(report, veni):
    """`veni-cli bake` of one latent and both graphs."""
    rows, columns = 32, 64
    ours, sizes = model_sizes(MODEL)
    with tempfile.TemporaryDirectory() as folder:
        panorama = next(iter(sorted((ROOT / "assets/panoramas/val").iterdir())))
        latent, image = Path(folder) / "z.json", Path(folder) / "z.exr"
        common = ["--quiet", "--model", str(MODEL)]
        subprocess.run([veni, "encode", str(panorama), "-o", str(latent), *common], check=True, stdout=subprocess.DEVNULL)
        size = ["--size", f"{columns}x{rows}", "--float", "--device", "cpu"]
        subprocess.run([veni, "bake", str(latent), "-o", str(image), *size, *common], check=True, stdout=subprocess.DEVNULL)
        told = json.loads(latent.read_text())
        radiance = exr.read(image)
    expected = radiance.double().log() - told.get("exposure", 0.0)
    vectors = torch.tensor(told["vectors"])[None]
    directions = training.panorama_directions(rows, columns)
    for name, graph in GRAPHS.items():
        decoded = graph(sizes, ours).decode(vectors, directions).detach().reshape(rows, columns, 3)
        error = (decoded - expected).abs().max().item()
        report.within(f"log radiance of `veni-cli bake` and of the graph {name}", error, 1e-4)
    turned = graph(sizes, ours).decode(vectors, directions.roll(1, 0)).detach().reshape(rows, columns, 3)
    report.beyond("directions of the neighbouring pixel", (turned - expected).abs().max().item(), 1e-4)


def recorded(report, preset, path):
    """A step of ours: its weights and batch through both graphs, its losses and gradients."""
    tensors, _ = weights.read(path)

    def part(prefix):
        return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}

    batch, ours, values, given = part("batch."), part("weight."), part("loss."), part("gradient.")
    sizes = presets.of(preset, batch["noise"].shape[1])
    batch = training.Batch(*(batch[k] for k in ("directions", "log_radiance", "loss_directions", "target", "noise")))
    # what the loss does not depend on has no gradient there
    given = {name: given.get(name, torch.zeros_like(w)) for name, w in ours.items()}
    what = f"({preset}, N = {sizes.latent_vectors})"
    # the VN-ReLUs of a network that has learnt nothing amplify rounding; how much shows PyTorch's own
    exact = step(GRAPHS["folded"](sizes, ours, F64), sizes, batch, F64)[1]
    allowed = 0.0
    for name, graph in GRAPHS.items():
        terms, gradients = step(graph(sizes, ours), sizes, batch, torch.float32)
        terms = {k: v.reshape(1) for k, v in terms.items()}
        report.within(f"losses of our step {what} and of the graph {name}", difference(terms, values), 1e-4)
        error = difference(gradients, exact)
        report.within(f"gradients of the graph {name} in f32 {what} and of the folded in f64", error, 2e-2)
        allowed = max(allowed, 4 * error, 1e-4)
    report.within(f"gradients of our step {what} and of the folded graph in f64", difference(given, exact), allowed)
    bent = replace(sizes, losses={**sizes.losses, "mage": 1.01 * sizes.losses["mage"]})
    terms = {k: v.reshape(1) for k, v in step(graph(bent, ours), bent, batch, torch.float32)[0].items()}
    report.beyond("a weight of a loss that is 1 % off", difference(terms, values), 1e-4)


def run(veni_cli=None, records=()):
    """Whether everything agrees; `records` are (preset, file)."""
    torch.manual_seed(0)
    report = Report()
    each_other(report)
    golden.compare(report)
    if veni_cli:
        baked(report, veni_cli)
    for preset, path in records:
        recorded(report, preset, path)
    print(f"{report.failed} failed")
    return report.failed == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--veni-cli", metavar="BINARY", help="compare with what it bakes")
    parser.add_argument(
        "--record", nargs=2, action="append", default=[], metavar=("PRESET", "FILE"), help="what train_step --record wrote",
    )
    arguments = parser.parse_args()
    sys.exit(0 if run(arguments.veni_cli, arguments.record) else 1)


if __name__ == "__main__":
    main()
