"""Shows that both graphs compute what this project and the authors' program compute, before anything is timed.

    python benches/peer/check.py [--veni BINARY] [--record FILE]

1. The graphs agree with each other: losses and the gradient of every weight, in f64 and f32, in both forms, with the
   weights of the shipped model.
2. The graphs agree with the authors' recorded numbers (tests/golden): encoder, decoder, losses, three training steps.
3. `--veni`: the decoder agrees with what `veni-cli bake` writes.
4. `--record`: losses and gradients agree with those of a step of ours, as `train_step … --record FILE` wrote them.
5. Deliberate breaks are seen.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import torch

import exr
import losses
import sizes as presets
import training
import weights
from graphs import GRAPHS

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "tests" / "golden"
MODEL = ROOT / "assets" / "veni-27.safetensors"
F64 = torch.float64


class Report:
    """Prints every comparison and remembers whether one failed."""

    def __init__(self):
        self.failed = 0

    def within(self, what, error, tolerance):
        good = error <= tolerance
        self.failed += not good
        print(f"{'ok    ' if good else 'FAILED'} {what}: {error:.1e} (allowed {tolerance:.1e})")

    def beyond(self, what, error, tolerance):
        good = error > tolerance
        self.failed += not good
        print(f"{'ok    ' if good else 'FAILED'} break is seen, {what}: {error:.1e} (more than {tolerance:.1e})")


def difference(a, b):
    """Of dictionaries of the same tensors the worst tensor's largest |a − b| over its largest |b|.

    A tensor that is (almost) 0 beside the others is measured by 1e-4 of the largest of them.
    """
    assert a.keys() == b.keys(), sorted(a.keys() ^ b.keys())[:5]
    largest = {name: b[name].abs().max().item() for name in b}
    least = 1e-4 * max(largest.values())
    return max((a[k].double() - b[k].double()).abs().max().item() / max(largest[k], least) for k in a)


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
            error = difference(found["authors", F64][index], exact[index])
            report.within(f"{form}, f64: {part} of the authors' graph and of the folded", error, 1e-9)
            for name in GRAPHS:
                error = difference(found[name, torch.float32][index], exact[index])
                report.within(f"{form}: {part} of the graph {name} in f32 and in f64", error, 1e-2 if index else 1e-4)
    # breaks: a weight, and the form
    bent = {**ours, "encoder.cls": ours["encoder.cls"] + 1e-3}
    error = difference(step(GRAPHS["authors"](sizes, bent, F64), sizes, batch, F64)[0], exact[0])
    report.beyond("a class token that is 0.001 off", error, 1e-9)
    other = model_sizes(MODEL)[1]
    error = difference(step(GRAPHS["authors"](replace(sizes, form=other.form), ours, F64), sizes, batch, F64)[0], exact[0])
    report.beyond("VN-ReLUs of the other form", error, 1e-9)


# ---- the authors' numbers ----


def golden(name):
    tensors, metadata = weights.read(GOLDEN / f"{name}.safetensors")
    return tensors, json.loads(metadata["config"]), json.loads(metadata.get("tol", "{}"))


def official(tensors, prefix, into):
    """Their weights under `prefix` by the names that the graphs use, which start with `into`."""
    return {into + name[len(prefix):]: w for name, w in tensors.items() if name.startswith(prefix)}


def with_their_weights(graph, sizes, theirs, kind=torch.float32):
    """A graph with these weights of theirs; what the case does not have is drawn."""
    made = GRAPHS[graph](sizes, {**weights.draw(sizes), **weights.from_authors(theirs, sizes)}, kind)
    if graph == "authors":
        for name in made.weights.keys() & theirs.keys():
            made.weights[name].data.copy_(theirs[name])
    return made


def against(report, what, tolerances, found, expected):
    """By the rule of the golden files: 10 × the recorded rounding, or 1e-6 + 1e-5 of the largest value."""
    shares = {}
    for name, b in expected.items():
        allowed = 1e-6 + 1e-5 * b.abs().max().item()
        if name in tolerances:
            allowed = max(allowed, 10 * tolerances[name]["f32_err"])
        shares[name] = (found[name].detach() - b).abs().max().item() / allowed
    worst = max(shares, key=shares.get)
    what = f"{what}: {len(expected)} numbers of the authors, in tolerances, worst {worst}"
    report.within(what, shares[worst], 1.0)


def encoder_sizes(config, latent_vectors):
    return dict(
        latent_vectors=latent_vectors, stripes=64, samples=config.get("patch_size", 512), channels=config["inner_dim"],
        depth=config["depth"], heads=config["heads"], head_channels=config["dim_head"],
    )


def authors_numbers(report):
    for graph in GRAPHS:
        tensors, config, tolerances = golden("c03_encoder_default_nomirror_p32")
        sizes = replace(presets.PAPER, **encoder_sizes(config, config["latent_dim"])).reference()
        made = with_their_weights(graph, sizes, official(tensors, "param.", "encoder."))
        mean, log_variance = made.encode(tensors["in.directions"], tensors["in.colors"])
        expected = {name: tensors[name] for name in ("out.mu", "out.logvar")}
        against(report, f"encoder, graph {graph}", tolerances, {"out.mu": mean, "out.logvar": log_variance}, expected)

        tensors, config, tolerances = golden("c05_veni_decoder_full_d9")
        sizes = replace(presets.PAPER, latent_vectors=9).reference()
        made = with_their_weights(graph, sizes, official(tensors, "param.", "field."))
        latent = tensors["in.latent"].requires_grad_()
        rgb = made.decode(latent, tensors["in.directions"])[:, None]
        (rgb * tensors["probe.rgb"]).sum().backward()
        expected = {"out.rgb": tensors["out.rgb"], "grad.in.latent": tensors["grad.in.latent"]}
        against(report, f"decoder, graph {graph}", tolerances, {"out.rgb": rgb, "grad.in.latent": latent.grad}, expected)
        expected = weights.from_authors(official(tensors, "grad.param.", "field."), sizes)
        gradients = {name: made.gradients()[name] for name in expected}
        to_their = {ours: "grad.param." + theirs.removeprefix("field.") for ours, theirs, _, _ in weights.pairs(sizes)}
        named = {ours: tolerances[to_their[ours]] for ours in expected if to_their[ours] in tolerances}
        against(report, f"gradients of the decoder, graph {graph}", named, gradients, expected)
        three_steps(report, graph)
    for case in ("c06_losses_16x32", "c06_losses_64x128"):
        tensors, config, tolerances = golden(case)
        prediction = tensors["in.pred"].requires_grad_()
        _, rows, columns, _ = prediction.shape
        sizes = replace(presets.PAPER, height=rows, width=columns).reference()
        terms = losses.Reference(sizes, torch.float32)(prediction, tensors["in.target"])
        terms["kld"] = sizes.losses["kld"] * losses.kld(tensors["in.mu"], tensors["in.logvar"])
        theirs = {
            "mage": "multi_scale_derivative_loss", "scale_invariant": "scale_inv_loss", "cosine": "cosine_similarity_loss",
            "kld": "kld_loss",
        }
        found, expected = {}, {}
        for name, value in terms.items():
            found[f"out.weighted.{theirs[name]}"] = value
            if name != "kld":
                (found[f"grad.{theirs[name]}.pred"],) = torch.autograd.grad(value, prediction)
        expected = {name: tensors[name] for name in found}
        against(report, f"losses, {case}", tolerances, found, expected)


def three_steps(report, graph):
    """Three steps of training with the optimiser: losses and gradients of the first, weights after each.

    In f64: where a gradient is almost 0, rounding decides which way Adam moves by the full rate.
    """
    tensors, config, tolerances = golden("c08_train_constlr")
    encoder, field = config["encoder"], config["field"]
    sizes = replace(
        presets.PAPER, **encoder_sizes({**encoder, "patch_size": config["patch_size"]}, field["latent_dim"]),
        batch=config["B"], height=config["H"], width=config["W"], hidden=field["hidden_features"],
        layers=field["num_attention_layers"], decoder_heads=field["num_attention_heads"],
    ).reference()
    adam = config["optim"]["adam"]
    constant = lambda rate: presets.Rate(rate, 0, 1, 1.0)
    sizes = replace(
        sizes, decoder_rate=constant(adam["lr_field"]), encoder_rate=constant(adam["lr_encoder"]),
        clip=config["optim"]["max_norm"],
    )
    theirs = official(tensors, "param.", "")
    made = with_their_weights(graph, sizes, {name: w for name, w in theirs.items() if w.dtype == torch.float32}, F64)
    loss, optimiser = training.Loss(sizes, F64), training.Optimiser(made, sizes)
    lines = golden("c04_directions")[0]["out.line_64_32"]
    found, expected, rules = {}, {}, {}
    for index in range(3):
        seen, colours = look(lines, tensors["in.yaw"][index], tensors["in.image"])
        # their `mirror`: "early"
        batch = training.Batch(
            seen * torch.tensor([-1.0, 1, 1]), colours, camera_directions(sizes.height, sizes.width), tensors["in.image"],
            tensors["in.eps"][index],
        ).to(F64)
        optimiser.zero()
        terms = loss(made, batch)
        sum(terms.values()).backward()
        name = f"out.step{index + 1}.loss"
        found[name], expected[name] = sum(terms.values()), tensors[name]
        if name in tolerances:
            rules[name] = tolerances[name]
        if index == 0:
            record(found, made.gradients(), "grad.", sizes)
        optimiser.step()
        now = made.weights if graph == "folded" else weights.from_authors(made.weights, sizes)
        record(found, {k: w.detach().clone() for k, w in now.items()}, f"after{index + 1}.", sizes)
    for name in list(found):
        if name not in expected:
            prefix, _, rest = name.partition(".")
            key = {ours: theirs for ours, theirs, _, _ in weights.pairs(sizes)}[rest]
            if f"{prefix}.{key}" not in tensors:
                del found[name]
                continue
            expected[name] = weights.from_authors({key: tensors[f"{prefix}.{key}"]}, sizes)[rest]
            if f"{prefix}.{key}" in tolerances:
                rules[name] = tolerances[f"{prefix}.{key}"]
    against(report, f"three training steps, graph {graph}", rules, found, expected)


def record(found, tensors, prefix, sizes):
    found.update({prefix + name: w for name, w in tensors.items()})


def camera_directions(rows, columns):
    """The authors' decoder frame: the centre looks along −y, the right along +x."""
    x, y, z = training.panorama_directions(rows, columns, F64).unbind(-1)
    return torch.stack([-y, -x, z], -1).float()


def look(lines, yaws, images):
    """Turned directions [B, T, P, 3] and the colours the authors' lookup finds there."""
    seen = []
    for yaw in yaws:
        (c, s), (x, y, z) = (yaw.cos(), yaw.sin()), lines.unbind(-1)
        # a matrix product adds the 0 of the third column, and no sum that is 0 is −0: at the poles signs decide
        seen.append(torch.stack([c * x + s * y + 0.0, c * y - s * x + 0.0, z], -1))
    seen = torch.stack(seen)
    x, y, z = seen.unbind(-1)
    grid = torch.stack([torch.atan2(x, y) / math.pi, torch.asin((z / seen.norm(dim=-1)).clamp(-1, 1)) / (math.pi / 2)], -1)
    colours = torch.nn.functional.grid_sample(
        images.permute(0, 3, 1, 2), grid, mode="bilinear", padding_mode="reflection", align_corners=False
    )
    return seen, colours.permute(0, 2, 3, 1)


# ---- our numbers ----


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
        report.within(f"log radiance of `veni-cli bake` and of the graph {name}", (decoded - expected).abs().max().item(), 1e-4)
    turned = graph(sizes, ours).decode(vectors, directions.roll(1, 0)).detach().reshape(rows, columns, 3)
    report.beyond("directions of the neighbouring pixel", (turned - expected).abs().max().item(), 1e-4)


def recorded(report, path):
    """A step of ours: weights, batch, losses and gradients."""
    tensors, _ = weights.read(path)
    part = lambda prefix: {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
    told, batch, ours = part("size."), part("batch."), part("weight.")
    preset = next(k for k in presets.PRESETS if f"preset.{k}" in tensors)
    sizes = presets.of(preset, batch["noise"].shape[1])
    batch = training.Batch(*(batch[k] for k in ("directions", "log_radiance", "loss_directions", "target", "noise")))
    assert not told
    expected = part("loss."), part("gradient.")
    for name, graph in GRAPHS.items():
        found = step(graph(sizes, ours), sizes, batch, torch.float32)
        values = {k: v.reshape(1) for k, v in found[0].items()}
        report.within(f"losses of our step ({preset}) and of the graph {name}", difference(values, expected[0]), 1e-4)
        report.within(f"gradients of our step ({preset}) and of the graph {name}", difference(found[1], expected[1]), 1e-2)


def run(veni=None, record_file=None):
    """Whether everything agrees."""
    torch.manual_seed(0)
    report = Report()
    each_other(report)
    authors_numbers(report)
    if veni:
        baked(report, veni)
    if record_file:
        recorded(report, record_file)
    print(f"{report.failed} failed")
    return report.failed == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--veni", metavar="BINARY", help="veni-cli: compare with what it bakes")
    parser.add_argument("--record", metavar="FILE", help="what `train_step … --record FILE` wrote")
    arguments = parser.parse_args()
    sys.exit(0 if run(arguments.veni, arguments.record) else 1)


if __name__ == "__main__":
    main()
