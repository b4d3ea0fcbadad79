"""Weights by name: drawn, read from files, and rewritten between our names and layouts and those of the reference implementation.

Ours are those of the model file: maps are [in, out], features [.., coordinate, channel]. The maps of the reference implementation are
[out, in], features [.., channel, coordinate]. Every weight of ours has exactly one of theirs; theirs has the queries and
keys of the decoder besides, which change nothing.
"""

import json
import math
import struct

import numpy as np
import torch

TYPES = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "I32": "<i4", "I64": "<i8", "U8": "|u1", "BOOL": "|b1"}


def read(path):
    """Tensors and metadata of a safetensors file; floats become f32."""
    with open(path, "rb") as file:
        (length,) = struct.unpack("<Q", file.read(8))
        header = json.loads(file.read(length))
        body = file.read()
    metadata = header.pop("__metadata__", {})
    tensors = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        values = np.frombuffer(body[begin:end], dtype=TYPES[entry["dtype"]]).reshape(entry["shape"])
        values = values.astype(np.float32) if values.dtype.kind == "f" else values.copy()
        tensors[name] = torch.from_numpy(values)
    return tensors, metadata


def shapes(sizes):
    """Every weight of ours: name → (shape, inputs of its map; 0 for norms and the class token)."""
    n, c, hidden = sizes.latent_vectors, sizes.channels, sizes.hidden
    inner, wide = sizes.heads * sizes.head_channels, sizes.channels * sizes.expansion
    found = {}

    def so2(name, into, out, invariants):
        found[f"{name}.equivariant"] = (5 * into, out), 5 * into + out
        found[f"{name}.invariant"] = (5 * into, invariants * out), 5 * into
        found[f"{name}.bias"] = (invariants * out,), 5 * into

    def matrix(name, into, out):
        found[name] = (into, out), into

    def linear(name, into, out):
        matrix(f"{name}.weight", into, out)
        found[f"{name}.bias"] = (out,), into

    found["encoder.cls"] = (4, c), 0
    so2("encoder.project_in", sizes.samples, c, 4)
    so2("encoder.project_out", c, n, 1)
    so2("encoder.project_log_variance", c, n, 1)
    for layer in (f"encoder.transformer.layers.{index}" for index in range(sizes.depth)):
        for part in ("query", "key", "value"):
            matrix(f"{layer}.attention.{part}.weight", c, inner)
        matrix(f"{layer}.attention.out.weight", inner, c)
        matrix(f"{layer}.feed_forward.expand.weight", c, wide)
        matrix(f"{layer}.feed_forward.relu.w", wide, wide)
        matrix(f"{layer}.feed_forward.relu.u", wide, wide)
        matrix(f"{layer}.feed_forward.contract.weight", wide, c)
        found[f"{layer}.norm1.gamma"] = found[f"{layer}.norm2.gamma"] = (c,), 0
    found["decoder.condition.scale"] = (1,), 1
    matrix("decoder.condition.linear", 1, 2)
    matrix("decoder.condition.w", 2, 2)
    matrix("decoder.condition.u", 2, 2)
    linear("decoder.input", 5 * (n + 2), hidden)
    linear("decoder.output", hidden, 3)
    for layer in (f"decoder.layers.{index}" for index in range(sizes.layers)):
        linear(f"{layer}.value", 3 * n, hidden)
        for part in ("out", "ff1", "ff2"):
            linear(f"{layer}.{part}", hidden, hidden)
        for part in ("norm1.gamma", "norm1.beta", "norm2.gamma", "norm2.beta"):
            found[f"{layer}.{part}"] = (hidden,), 0
    return found


def draw(sizes, seed=0):
    """Weights at the start of a training: U(±1/√inputs), norms at identity, class token 0."""
    generator = torch.Generator().manual_seed(seed)
    found = {}
    for name, (shape, inputs) in shapes(sizes).items():
        if inputs:
            found[name] = (2 * torch.rand(shape, generator=generator) - 1) / math.sqrt(inputs)
        else:
            found[name] = torch.ones(shape) if name.endswith("gamma") else torch.zeros(shape)
    # a projecting VN-ReLU whose ⟨q, k⟩ is negative for every latent would never learn
    linear, w, u = (found[f"decoder.condition.{part}"] for part in ("linear", "w", "u"))
    found["decoder.condition.u"] = torch.where((linear @ w) * (linear @ u) < 0, -u, u)
    return found


ATTENTION = {"query": "to_q", "key": "to_k", "value": "to_v", "out": "to_out"}
MATRICES = {"expand.weight": "0.weight", "relu.w": "1.W", "relu.u": "1.U", "contract.weight": "2.weight"}
PERCEPTRON = {"value": "mha.value", "out": "mha.fc_out", "ff1": "fc.0", "ff2": "fc.2"}
SO2 = {"project_in": "vn_proj_in.1", "project_out": "project_out", "project_log_variance": "project_out_logvar"}


def pairs(sizes):
    """(our name, their name, ours → theirs, theirs → ours) of every weight."""
    transpose = (lambda w: w.T, lambda w: w.T)
    same = (lambda w: w, lambda w: w)
    terms = 5

    def so2(ours, theirs, into, out, invariants):
        yield (
            f"{ours}.equivariant", f"{theirs}.equivariant_weights",
            # rows are term by term, of each all channels
            lambda w: w.reshape(terms, into, out).permute(2, 0, 1), lambda w: w.permute(1, 2, 0).reshape(terms * into, out),
        )
        yield (
            f"{ours}.invariant", f"{theirs}.invariant_linear.1.weight",
            lambda w: w.reshape(terms, into, invariants, out).permute(3, 2, 1, 0).reshape(out * invariants, into * terms),
            lambda w: w.reshape(out, invariants, into, terms).permute(3, 2, 1, 0).reshape(terms * into, invariants * out),
        )
        yield (
            f"{ours}.bias", f"{theirs}.invariant_linear.1.bias",
            lambda b: b.reshape(invariants, out).T.reshape(-1), lambda b: b.reshape(out, invariants).T.reshape(-1),
        )

    def linear(ours, theirs):
        yield (f"{ours}.weight", f"{theirs}.weight", *transpose)
        yield (f"{ours}.bias", f"{theirs}.bias", *same)

    c, n = sizes.channels, sizes.latent_vectors
    yield ("encoder.cls", "encoder.cls_inv", lambda w: w.T[None, None], lambda w: w[0, 0].T)
    dimensions = {"project_in": (sizes.samples, c, 4), "project_out": (c, n, 1), "project_log_variance": (c, n, 1)}
    for ours, theirs in SO2.items():
        yield from so2(f"encoder.{ours}", f"encoder.{theirs}", *dimensions[ours])
    for index in range(sizes.depth):
        ours, theirs = f"encoder.transformer.layers.{index}", f"encoder.encoder.layers.{index}"
        for a, b in ATTENTION.items():
            yield (f"{ours}.attention.{a}.weight", f"{theirs}.0.{b}.weight", *transpose)
        for a, b in MATRICES.items():
            yield (f"{ours}.feed_forward.{a}", f"{theirs}.2.{b}", *transpose)
        yield (f"{ours}.norm1.gamma", f"{theirs}.1.ln.gamma", *same)
        yield (f"{ours}.norm2.gamma", f"{theirs}.3.ln.gamma", *same)
    yield ("decoder.condition.scale", "field.vn_proj_in.1.weight", lambda w: w.reshape(1, 1), lambda w: w.reshape(1))
    yield ("decoder.condition.linear", "field.vn_invar.mlp.0.weight", *transpose)
    yield ("decoder.condition.w", "field.vn_invar.mlp.1.W", *transpose)
    yield ("decoder.condition.u", "field.vn_invar.mlp.1.U", *transpose)
    yield from linear("decoder.input", "field.network.residual_projection")
    yield from linear("decoder.output", "field.network.fc")
    for index in range(sizes.layers):
        ours, theirs = f"decoder.layers.{index}", f"field.network.layers.{index}"
        for a, b in PERCEPTRON.items():
            yield from linear(f"{ours}.{a}", f"{theirs}.{b}")
        for norm in ("norm1", "norm2"):
            yield (f"{ours}.{norm}.gamma", f"{theirs}.{norm}.weight", *same)
            yield (f"{ours}.{norm}.beta", f"{theirs}.{norm}.bias", *same)


def to_reference(ours, sizes, seed=1):
    """Our weights as theirs. The queries and keys of the decoder, which we do not have, are drawn."""
    found = {theirs: there(ours[name]).contiguous() for name, theirs, there, _ in pairs(sizes) if name in ours}
    generator = torch.Generator().manual_seed(seed)
    hidden, condition = sizes.hidden, 3 * sizes.latent_vectors
    kind = ours["decoder.output.weight"].dtype
    for layer in (f"field.network.layers.{index}.mha" for index in range(sizes.layers)):
        for part, inputs in (("query", hidden), ("key", condition)):
            for name, shape in ((f"{layer}.{part}.weight", (hidden, inputs)), (f"{layer}.{part}.bias", (hidden,))):
                drawn = (2 * torch.rand(shape, generator=generator) - 1) / math.sqrt(inputs)
                found[name] = drawn.to(kind)
    return found


def from_reference(theirs, sizes):
    """Their weights (or gradients) by our names, those that are there."""
    return {ours: back(theirs[name]).contiguous() for ours, name, _, back in pairs(sizes) if name in theirs}
