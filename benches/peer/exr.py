"""Reads the float scan-line OpenEXR files that `veni-cli bake --float` writes: no compression, or ZIP."""

import struct
import zlib

import numpy as np
import torch

# lines per block, by the number of the compression
LINES = {0: 1, 2: 1, 3: 16}


def read(path):
    """Linear radiance [rows, columns, 3]."""
    data = open(path, "rb").read()
    assert data[:4] == b"\x76\x2f\x31\x01", f"{path}: not an OpenEXR file"
    attributes, at = {}, 8
    while data[at]:
        name, at = text(data, at)
        _, at = text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    rows, columns = bottom - top + 1, right - left + 1
    channels = channel_names(attributes["channels"], path)
    compression = attributes["compression"][0]
    assert compression in LINES, f"{path}: compression {compression} is not read here"
    blocks = -(-rows // LINES[compression])
    image = np.zeros((rows, len(channels), columns), np.float32)
    for offset in struct.unpack_from(f"<{blocks}Q", data, at + 1):
        first, size = struct.unpack_from("<2i", data, offset)
        first -= top
        lines = min(LINES[compression], rows - first)
        block = data[offset + 8 : offset + 8 + size]
        expected = 4 * lines * len(channels) * columns
        if len(block) < expected:
            block = unpredict(zlib.decompress(block))
        image[first : first + lines] = np.frombuffer(block, "<f4").reshape(lines, len(channels), columns)
    order = [channels.index(c) for c in "RGB"]
    return torch.from_numpy(image[:, order].transpose(0, 2, 1).copy())


def text(data, at):
    end = data.index(0, at)
    return data[at:end].decode(), end + 1


def channel_names(data, path):
    names, at = [], 0
    while data[at]:
        name, at = text(data, at)
        (kind,) = struct.unpack_from("<i", data, at)
        assert kind == 2, f"{path}: channel {name} is not float; bake with --float"
        names.append(name)
        at += 16
    return names


def unpredict(packed):
    """Undoes the differences of ZIP blocks and puts their two halves together."""
    values = np.frombuffer(packed, np.uint8).astype(np.int64)
    values[1:] -= 128
    values = (np.cumsum(values) & 255).astype(np.uint8)
    half = (len(values) + 1) // 2
    out = np.empty_like(values)
    out[0::2], out[1::2] = values[:half], values[half:]
    return out.tobytes()
