"""The numbers that the reference implementation gave (tests/golden; docs/MODEL.md has the equations), against both graphs."""

import json
import math
from dataclasses import replace
from pathlib import Path

import torch

import losses
import sizes as presets
import training
import weights
from graphs import GRAPHS

GOLDEN = Path(__file__).resolve().parents[2] / "tests" / "golden"
F64 = torch.float64
# Our parts of the network and theirs
PARTS = (("decoder", "field"), ("encoder", "encoder"))
# Our losses by the names of the reference implementation
LOSSES = {
    "mage": "multi_scale_derivative_loss", "scale_invariant": "scale_inv_loss", "cosine": "cosine_similarity_loss",
    "kld": "kld_loss",
}


def case(name):
    """Tensors, configuration and tolerances of a file."""
    tensors, metadata = weights.read(GOLDEN / f"{name}.safetensors")
    return tensors, json.loads(metadata["config"]), json.loads(metadata.get("tol", "{}"))


def official(tensors, prefix, into):
    """Their weights under `prefix` by the names that the graphs use, which start with `into`."""
    return {into + name[len(prefix):]: w for name, w in tensors.items() if name.startswith(prefix)}


def with_their_weights(graph, sizes, theirs, kind=torch.float32):
    """A graph with these weights of theirs; what the case does not have is drawn."""
    made = GRAPHS[graph](sizes, {**weights.draw(sizes), **weights.from_reference(theirs, sizes)}, kind)
    if graph == "reference":
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
    what = f"{what}: {len(expected)} numbers of the reference implementation, in tolerances, worst {worst}"
    report.within(what, shares[worst], 1.0)


def encoder_sizes(config, latent_vectors):
    return dict(
        latent_vectors=latent_vectors, stripes=64, samples=config.get("patch_size", 512), channels=config["inner_dim"],
        depth=config["depth"], heads=config["heads"], head_channels=config["dim_head"],
    )


def compare(report):
    """Both graphs, and the losses, against the recorded numbers."""
    for graph in GRAPHS:
        encoder(report, graph)
        decoder(report, graph)
        three_steps(report, graph)
    for name in ("c06_losses_16x32", "c06_losses_64x128"):
        of_images(report, name)


def encoder(report, graph):
    tensors, config, tolerances = case("c03_encoder_default_nomirror_p32")
    sizes = replace(presets.PAPER, **encoder_sizes(config, config["latent_dim"])).reference()
    made = with_their_weights(graph, sizes, official(tensors, "param.", "encoder."))
    mean, log_variance = made.encode(tensors["in.directions"], tensors["in.colors"])
    found = {"out.mu": mean, "out.logvar": log_variance}
    against(report, f"encoder, graph {graph}", tolerances, found, {name: tensors[name] for name in found})


def decoder(report, graph):
    tensors, _, tolerances = case("c05_veni_decoder_full_d9")
    sizes = replace(presets.PAPER, latent_vectors=9).reference()
    made = with_their_weights(graph, sizes, official(tensors, "param.", "field."))
    latent = tensors["in.latent"].requires_grad_()
    rgb = made.decode(latent, tensors["in.directions"])[:, None]
    (rgb * tensors["probe.rgb"]).sum().backward()
    found = {"out.rgb": rgb, "grad.in.latent": latent.grad}
    against(report, f"decoder, graph {graph}", tolerances, found, {name: tensors[name] for name in found})

    theirs = official(tensors, "grad.param.", "field.")
    expected = weights.from_reference(theirs, sizes)
    keys = {ours: "grad.param." + key.removeprefix("field.") for ours, key, _, _ in weights.pairs(sizes)}
    rules = {ours: tolerances[keys[ours]] for ours in expected if keys[ours] in tolerances}
    against(report, f"gradients of the decoder, graph {graph}", rules, made.gradients(), expected)


def of_images(report, name):
    """Every loss and its gradient."""
    tensors, _, tolerances = case(name)
    prediction = tensors["in.pred"].requires_grad_()
    _, rows, columns, _ = prediction.shape
    sizes = replace(presets.PAPER, height=rows, width=columns).reference()
    terms = losses.Reference(sizes, torch.float32)(prediction, tensors["in.target"])
    terms["kld"] = sizes.losses["kld"] * losses.kld(tensors["in.mu"], tensors["in.logvar"])
    found = {}
    for term, value in terms.items():
        found[f"out.weighted.{LOSSES[term]}"] = value
        if term != "kld":
            (found[f"grad.{LOSSES[term]}.pred"],) = torch.autograd.grad(value, prediction)
    against(report, f"losses, {name}", tolerances, found, {key: tensors[key] for key in found})


def three_steps(report, graph):
    """Three steps of training with the optimiser: losses and gradients of the first, weights after each.

    In f64: where a gradient is almost 0, rounding decides which way Adam moves by the full rate.
    """
    tensors, config, tolerances = case("c08_train_constlr")
    looks, field = config["encoder"], config["field"]
    sizes = replace(
        presets.PAPER, **encoder_sizes({**looks, "patch_size": config["patch_size"]}, field["latent_dim"]),
        batch=config["B"], height=config["H"], width=config["W"], hidden=field["hidden_features"],
        layers=field["num_attention_layers"], decoder_heads=field["num_attention_heads"],
    ).reference()
    adam = config["optim"]["adam"]
    sizes = replace(
        sizes, clip=config["optim"]["max_norm"],
        **{f"{part}_rate": presets.Rate(adam[f"lr_{key}"], 0, 1, 1.0) for part, key in PARTS},
    )
    theirs = official(tensors, "param.", "")
    made = with_their_weights(graph, sizes, {name: w for name, w in theirs.items() if w.dtype == torch.float32}, F64)
    loss, optimiser = training.Loss(sizes, F64), training.Optimiser(made, sizes)
    lines = case("c04_directions")[0]["out.line_64_32"]
    found, totals = {}, {}
    for index in range(3):
        seen, colours = look(lines, tensors["in.yaw"][index], tensors["in.image"])
        # their `mirror`: "early"
        seen = seen * torch.tensor([-1.0, 1, 1])
        view = camera_directions(sizes.height, sizes.width)
        batch = training.Batch(seen, colours, view, tensors["in.image"], tensors["in.eps"][index]).to(F64)
        optimiser.zero()
        total = sum(loss(made, batch).values())
        total.backward()
        totals[f"out.step{index + 1}.loss"] = total
        if index == 0:
            found.update({("grad", name): w.clone() for name, w in made.gradients().items()})
        optimiser.step()
        now = weights.from_reference(made.weights, sizes) if graph == "reference" else made.weights
        found.update({(f"after{index + 1}", name): w.detach().clone() for name, w in now.items()})
    expected, rules = {name: tensors[name] for name in totals}, {k: v for k, v in tolerances.items() if k in totals}
    keys = {ours: key for ours, key, _, _ in weights.pairs(sizes)}
    for record, name in found:
        key = f"{record}.{keys[name]}"
        if key in tensors:
            label = f"{record} {name}"
            totals[label] = found[record, name]
            expected[label] = weights.from_reference({keys[name]: tensors[key]}, sizes)[name]
            if key in tolerances:
                rules[label] = tolerances[key]
    against(report, f"three training steps, graph {graph}", rules, totals, expected)


def camera_directions(rows, columns):
    """The reference implementation's decoder frame: the centre looks along −y, the right along +x."""
    x, y, z = training.panorama_directions(rows, columns, F64).unbind(-1)
    return torch.stack([-y, -x, z], -1).float()


def look(lines, yaws, images):
    """Rotated directions [B, T, P, 3] and the colours the reference implementation's lookup finds there."""
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
