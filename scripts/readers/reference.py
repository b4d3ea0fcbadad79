"""What a file holds, straight from the formats' specifications: OpenEXR scan lines (ZIP or none) and Radiance RGBE."""

import struct
import zlib

import numpy as np


def exr(path):
    """Height x width x 3 of float32, and the text attributes."""
    data = path.read_bytes()
    assert data[:4] == b"\x76\x2f\x31\x01", path
    at, attributes, window, kinds = 8, {}, None, {}
    while data[at]:
        name, at = data[at : data.index(0, at)].decode(), data.index(0, at) + 1
        kind, at = data[at : data.index(0, at)].decode(), data.index(0, at) + 1
        (size,) = struct.unpack_from("<i", data, at)
        value, at = data[at + 4 : at + 4 + size], at + 4 + size
        if kind == "string":
            attributes[name] = value.decode()
        elif name == "dataWindow":
            window = struct.unpack("<4i", value)
        elif name == "compression":
            compression = value[0]
        elif name == "channels":
            k = 0
            while value[k]:
                end = value.index(0, k)
                kinds[value[k:end].decode()] = "<f2" if value[end + 1] == 1 else "<f4"
                k = end + 17
    width, height = window[2] - window[0] + 1, window[3] - window[1] + 1
    assert sorted(kinds) == ["B", "G", "R"] and len(set(kinds.values())) == 1, kinds
    kind = np.dtype(kinds["R"])
    rows = {0: 1, 2: 1, 3: 16}[compression]
    at += 1 + 8 * -(-height // rows)
    out = np.empty((height, width, 3), np.float32)
    for top in range(0, height, rows):
        count = min(rows, height - top)
        (size,) = struct.unpack_from("<i", data, at + 4)
        packed, at = data[at + 8 : at + 8 + size], at + 8 + size
        if size < count * width * 3 * kind.itemsize:
            packed = unzip(packed)
        block = np.frombuffer(packed, kind).reshape(count, 3, width)
        out[top : top + count] = block[:, ::-1].transpose(0, 2, 1)
    return out, attributes


def unzip(packed):
    """Deflate, the predictor, the split into even and odd bytes."""
    raw = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
    raw[1:] -= 128
    raw = (np.cumsum(raw) & 255).astype(np.uint8)
    out = np.empty_like(raw)
    out[0::2], out[1::2] = raw[: (len(raw) + 1) // 2], raw[(len(raw) + 1) // 2 :]
    return out.tobytes()


def hdr(path):
    """Height x width x 3 of float32, and the header's lines."""
    header, rest = path.read_bytes().split(b"\n\n", 1)
    size, data = rest.split(b"\n", 1)
    _, height, _, width = size.split()
    height, width, at = int(height), int(width), 0
    out = np.empty((height, width, 4), np.uint8)
    for row in out:
        if not 8 <= width < 32768:
            row[:] = np.frombuffer(data, np.uint8, 4 * width, at).reshape(width, 4)
            at += 4 * width
            continue
        assert data[at : at + 4] == bytes([2, 2, width >> 8, width & 255])
        at += 4
        for channel in range(4):
            column = 0
            while column < width:
                count = data[at]
                if count > 128:
                    count -= 128
                    row[column : column + count, channel] = data[at + 1]
                    at += 2
                else:
                    row[column : column + count, channel] = list(data[at + 1 : at + 1 + count])
                    at += 1 + count
                column += count
    assert at == len(data), "bytes behind the last row"
    scale = np.exp2(out[..., 3:].astype(np.float64) - 136)
    return (out[..., :3] * scale).astype(np.float32), header.decode().splitlines()
