"""The folded graph: the same function with what does not depend on the ray, or is not read, computed once or not at all.

Features are [.., coordinate, channel] and maps of channels plain matrix products. The attention of the decoder has one
key: what it adds is one vector per panorama and layer. All arguments of the input's sines are one product of the
latent and (d_x, d_y, d_z, |d_xy|, 1). VN-ReLUs multiply by the products A·W and A·U. The last block of the encoder
computes the class token only. Otherwise PyTorch's own fused operations do what they can: layer norm, attention, affine maps.
"""

import math

import torch
from torch.nn import functional as F


class Folded:
    def __init__(self, sizes, ours, kind=torch.float32):
        self.sizes = sizes
        self.weights = {name: w.to(kind).clone().requires_grad_() for name, w in ours.items()}

    def groups(self):
        """Weights of the decoder and of the encoder."""
        named = self.weights.items()
        return [[w for name, w in named if name.startswith(part)] for part in ("decoder.", "encoder.")]

    def gradients(self):
        """By name. U of the invariants enters their true projection by its sign only: 0."""
        return {name: torch.zeros_like(w) if w.grad is None else w.grad for name, w in self.weights.items()}

    # ---- encoder ----

    def encode(self, directions, log_radiance):
        directions, log_radiance = directions.transpose(2, 3), log_radiance.transpose(2, 3)
        still = torch.cat([directions[:, :, 2:], log_radiance], 2)
        turning, still = self.so2(directions[:, :, :2], still, "encoder.project_in")
        invariant = self.weights["encoder.cls"].expand(turning.shape[0], 1, -1, -1)
        cls = torch.cat([torch.zeros_like(invariant[:, :, :2]), invariant], 2)
        x = torch.cat([cls, torch.cat([turning, still], 2)], 1)
        for index in range(self.sizes.depth):
            layer = f"encoder.transformer.layers.{index}"
            looking = x[:, :1] if index + 1 == self.sizes.depth else x
            x = looking + self.vn_norm(self.vn_attention(looking, x, f"{layer}.attention"), f"{layer}.norm1")
            x = x + self.vn_norm(self.vn_perceptron(x, f"{layer}.feed_forward"), f"{layer}.norm2")
        token = x[:, :1]
        mean = torch.cat(self.so2(token[:, :, :2], token[:, :, 2:], "encoder.project_out"), 2)
        spread, level = self.so2(token[:, :, :2], token[:, :, 2:], "encoder.project_log_variance")
        log_variance = lengths(spread) + level
        return mean.squeeze(1).transpose(1, 2), log_variance.squeeze(1).transpose(1, 2)

    def so2(self, turning, still, name):
        """SO(2) fully connected: [B, T, 2, d] and [B, T, c, d] → [B, T, 2, o] and [B, T, c′, o]."""
        products = torch.cat([turning[:, :, :, None], turning[:, :, :, None] * still[:, :, None]], 3).flatten(3)
        numbers = torch.cat([still, lengths(turning)], 2).flatten(2)
        equivariant, invariant = self.weights[f"{name}.equivariant"], self.weights[f"{name}.invariant"]
        flat = torch.addmm(self.weights[f"{name}.bias"], numbers.flatten(0, 1), invariant)
        return products @ equivariant, flat.reshape(*numbers.shape[:2], -1, equivariant.shape[1])

    def vn_norm(self, x, name):
        length = lengths(x)
        scaled = F.layer_norm(length, length.shape[-1:], self.weights[f"{name}.gamma"], None, 1e-5)
        return x * (scaled / length.clamp_min(1e-6))

    def vn_attention(self, looking, x, name):
        count, width = self.sizes.heads, self.sizes.head_channels
        weight = {part: self.weights[f"{name}.{part}.weight"] for part in ("query", "key", "value", "out")}

        def heads(features):
            batch, tokens, coordinates, _ = features.shape
            split = features.reshape(batch, tokens, coordinates, count, width)
            return split.permute(0, 3, 1, 2, 4).reshape(batch, count, tokens, coordinates * width)

        if looking is x:
            q, k, v = (x @ torch.cat([weight["query"], weight["key"], weight["value"]], 1)).chunk(3, -1)
        else:
            q = looking @ weight["query"]
            k, v = (x @ torch.cat([weight["key"], weight["value"]], 1)).chunk(2, -1)
        seen = F.scaled_dot_product_attention(heads(q), heads(k), heads(v))
        batch, _, tokens, _ = seen.shape
        seen = seen.reshape(batch, count, tokens, -1, width).permute(0, 2, 3, 1, 4)
        return seen.reshape(batch, tokens, -1, count * width) @ weight["out"]

    def vn_perceptron(self, x, name):
        expand, w, u = (self.weights[f"{name}.{part}"] for part in ("expand.weight", "relu.w", "relu.u"))
        rows = x[..., 0].numel()
        (into, wide), both = expand.shape, torch.cat([w, u], 1)
        # for few rows the factors one after the other are fewer multiplications
        if 2 * into * wide + rows * into < 2 * rows * wide:
            q, k = (x @ (expand @ both)).chunk(2, -1)
        else:
            q, k = ((x @ expand) @ both).chunk(2, -1)
        along = (q * k).sum(2, keepdim=True)
        square = (k * k).sum(2, keepdim=True)
        divisor = square.clamp_min(1e-6).sqrt() if self.sizes.form == "reference" else square.clamp_min(1e-30)
        return torch.addcmul(q, k, F.relu(-along) / divisor) @ self.weights[f"{name}.contract.weight"]

    # ---- decoder ----

    def decode(self, latent, directions):
        n = self.sizes.latent_vectors
        radius = directions[:, :2].norm(dim=-1, keepdim=True)
        basis = torch.cat([directions, radius, torch.ones_like(radius)], -1)
        basis = basis.expand(latent.shape[0], -1, -1)
        condition = self.condition(latent).flatten(1)
        attention = [self.attention(condition, index) for index in range(self.sizes.layers)]
        weight, bias = self.weights["decoder.input.weight"], self.weights["decoder.input.bias"]
        inputs = 4 * (n + 2)
        products = self.products(latent)
        waves = torch.sin(basis @ self.arguments(products))
        offset = F.pad((attention[0] + bias)[:, None], (0, 0, 4, 0))
        plain = basis @ (products @ weight[inputs:] + offset)
        x = torch.baddbmm(plain, waves, weight[:inputs].expand(len(latent), -1, -1))
        for index in range(self.sizes.layers):
            layer = f"decoder.layers.{index}"
            if index:
                x = x + attention[index][:, None]
            x = self.norm(x, f"{layer}.norm1")
            x = self.norm(x + self.linear(F.relu(self.linear(x, f"{layer}.ff1")), f"{layer}.ff2"), f"{layer}.norm2")
        return self.linear(x, "decoder.output")

    def condition(self, latent):
        """The closed form of the Vector-Neuron invariants, and z: [B, N, 3] → [B, N, 3]."""
        scale, linear, w, u = (self.weights[f"decoder.condition.{part}"] for part in ("scale", "linear", "w", "u"))
        t = (scale * latent[..., :2]).square().sum(-1, keepdim=True)
        alpha, beta = linear @ w, linear @ u
        dropped = (alpha * beta < 0).to(t.dtype)
        if self.sizes.form == "reference":
            square = beta.square() * t
            dropped = dropped * square / square.clamp_min(1e-6).sqrt()
        return torch.cat([alpha * t * (1 - dropped), latent[..., 2:]], -1)

    def products(self, latent):
        """The directional input (⟨z_xy, d_xy⟩ of every vector, d_z, |d_xy|), linear in the basis: [B, 5, N + 2]."""
        batch, n, _ = latent.shape
        horizontal = F.pad(latent[..., :2].transpose(1, 2), (0, 2))
        copies = torch.zeros(3, n + 2, dtype=latent.dtype)
        copies[0, n] = copies[1, n + 1] = 1
        return torch.cat([horizontal, copies.expand(batch, -1, -1)], 1)

    @staticmethod
    def arguments(products):
        """2πfx and 2πfx + π/2, frequencies 1 and 4, as a linear map of the basis: [B, 5, 4(N + 2)]."""
        frequencies = 2 * math.pi * torch.tensor([1.0, 4.0], dtype=products.dtype)
        waves = (products[..., None] * frequencies).flatten(2)
        quarter = torch.zeros(5, 1, dtype=products.dtype)
        quarter[4] = math.pi / 2
        return torch.cat([waves, waves + quarter], -1)

    def attention(self, condition, index):
        layer = f"decoder.layers.{index}"
        return self.linear(self.linear(condition, f"{layer}.value"), f"{layer}.out")

    def linear(self, x, name):
        return F.linear(x, self.weights[f"{name}.weight"].T, self.weights[f"{name}.bias"])

    def norm(self, x, name):
        return F.layer_norm(x, x.shape[-1:], self.weights[f"{name}.gamma"], self.weights[f"{name}.beta"], 1e-5)


def lengths(x):
    """Over the coordinates: [B, T, c, d] → [B, T, 1, d]. The gradient at 0 is 0."""
    return torch.linalg.vector_norm(x, dim=2, keepdim=True)
