"""The reference graph: everything computed where the paper's formulas put it, for every ray and every token.

Features are [.., channel, coordinate] and maps of channels are einsums. The decoder repeats the latent for every ray:
invariants, keys, values and the attention over its single key are computed ray by ray. VN-ReLUs apply W and U to the
expanded features. The last block of the encoder computes all tokens, of which one is read.
"""

import math

import torch
from torch import einsum
from torch.nn import functional as F

import weights as names


class Reference:
    def __init__(self, sizes, ours, kind=torch.float32):
        theirs = names.to_reference(ours, sizes)
        self.sizes = sizes
        self.weights = {name: w.to(kind).clone().requires_grad_() for name, w in theirs.items()}

    def groups(self):
        """Weights of the decoder and of the encoder."""
        named = self.weights.items()
        return [[w for name, w in named if name.startswith(part)] for part in ("field.", "encoder.")]

    def gradients(self):
        """By our names. Queries and keys of the decoder are left out; theirs are exactly 0."""
        found = {name: w.grad for name, w in self.weights.items() if w.grad is not None}
        return names.from_reference(found, self.sizes)

    # ---- encoder ----

    def encode(self, directions, log_radiance):
        x = torch.cat([directions, log_radiance], -1)
        x = self.so2(x, "encoder.vn_proj_in.1", 4)
        invariant = self.weights["encoder.cls_inv"].expand(x.shape[0], -1, -1, -1)
        cls = torch.cat([torch.zeros_like(invariant[..., :2]), invariant], -1)
        x = torch.cat([cls, x], 1)
        for index in range(self.sizes.depth):
            layer = f"encoder.encoder.layers.{index}"
            x = x + self.vn_norm(self.vn_attention(x, f"{layer}.0"), f"{layer}.1")
            x = x + self.vn_norm(self.vn_perceptron(x, f"{layer}.2"), f"{layer}.3")
        token = x[:, :1]
        mean = self.so2(token, "encoder.project_out", 1).squeeze(1)
        spread = self.so2(token, "encoder.project_out_logvar", 1).squeeze(1)
        return mean, spread[..., :2].norm(dim=-1, keepdim=True) + spread[..., 2:]

    def so2(self, x, name, invariants):
        """SO(2) fully connected: x [B, T, d, 2 + c] → [B, T, o, 2 + c′]."""
        equivariant, invariant = x[..., :2], x[..., 2:]
        lengths = equivariant.norm(dim=-1, keepdim=True)
        factors = torch.cat([torch.ones_like(lengths), invariant], -1)
        products = einsum("btik,btiv->btikv", factors, equivariant)
        turning = einsum("oki,btikv->btov", self.weights[f"{name}.equivariant_weights"], products)
        numbers = torch.cat([invariant, lengths], -1).flatten(2)
        linear = f"{name}.invariant_linear.1"
        still = F.linear(numbers, self.weights[f"{linear}.weight"], self.weights[f"{linear}.bias"])
        return torch.cat([turning, still.unflatten(-1, (-1, invariants))], -1)

    def vn_linear(self, x, name):
        return einsum("oi,...ic->...oc", self.weights[name], x)

    def vn_relu(self, x, name):
        q, k = self.vn_linear(x, f"{name}.W"), self.vn_linear(x, f"{name}.U")
        along = (q * k).sum(-1, keepdim=True)
        square = (k * k).sum(-1, keepdim=True)
        divisor = square.clamp_min(1e-6).sqrt() if self.sizes.form == "reference" else square.clamp_min(1e-30)
        return torch.where(along >= 0, q, q - along / divisor * k)

    def vn_norm(self, x, name):
        lengths = x.norm(dim=-1)
        scaled = F.layer_norm(lengths, lengths.shape[-1:], self.weights[f"{name}.ln.gamma"], None, 1e-5)
        return x * (scaled / lengths.clamp_min(1e-6)).unsqueeze(-1)

    def vn_attention(self, x, name):
        sizes = self.sizes

        def heads(part):
            split = self.vn_linear(x, f"{name}.{part}.weight").unflatten(2, (sizes.heads, sizes.head_channels))
            return split.transpose(1, 2).flatten(3)

        q, k, v = heads("to_q"), heads("to_k"), heads("to_v")
        logits = einsum("bhid,bhjd->bhij", q, k) / math.sqrt(q.shape[-1])
        seen = einsum("bhij,bhjd->bhid", logits.softmax(-1), v)
        seen = seen.unflatten(3, (sizes.head_channels, -1)).transpose(1, 2).flatten(2, 3)
        return self.vn_linear(seen, f"{name}.to_out.weight")

    def vn_perceptron(self, x, name):
        x = self.vn_linear(x, f"{name}.0.weight")
        return self.vn_linear(self.vn_relu(x, f"{name}.1"), f"{name}.2.weight")

    # ---- decoder ----

    def decode(self, latent, directions):
        batch, n, _ = latent.shape
        rays = directions.shape[0]
        latent = latent[:, None].expand(-1, rays, -1, -1).reshape(batch * rays, n, 3)
        directions = directions[None].expand(batch, -1, -1).reshape(batch * rays, 3)
        horizontal = latent[..., :2]
        inner = einsum("mnc,mc->mn", horizontal, directions[:, :2])
        radius = directions[:, :2].norm(dim=-1, keepdim=True)
        x = encoded(torch.cat([inner, directions[:, 2:], radius], -1))
        condition = self.condition(latent).flatten(1)
        x = self.linear(x, "field.network.residual_projection")
        for index in range(self.sizes.layers):
            layer = f"field.network.layers.{index}"
            x = self.norm(self.attention(x, condition, f"{layer}.mha") + x, f"{layer}.norm1")
            hidden = F.relu(self.linear(x, f"{layer}.fc.0"))
            x = self.norm(self.linear(hidden, f"{layer}.fc.2") + x, f"{layer}.norm2")
        return self.linear(x, "field.network.fc").reshape(batch, rays, 3)

    def condition(self, latent):
        """Vector-Neuron invariants of every latent vector, and its z: [M, N, 3] → [M, N, 3]."""
        y = self.vn_linear(latent[..., None, :2], "field.vn_proj_in.1.weight")
        a = self.vn_relu(self.vn_linear(y, "field.vn_invar.mlp.0.weight"), "field.vn_invar.mlp.1")
        invariants = einsum("mnci,mnoi->mnco", y, a).squeeze(2)
        return torch.cat([invariants, latent[..., 2:]], -1)

    def attention(self, x, condition, name):
        """Multi-head attention of every ray over one token, its own copy of what it is conditioned on."""
        count = self.sizes.decoder_heads

        def heads(of, part):
            return self.linear(of[:, None], f"{name}.{part}").unflatten(-1, (count, -1)).transpose(1, 2)

        q, k, v = heads(x, "query"), heads(condition, "key"), heads(condition, "value")
        logits = einsum("mhqd,mhkd->mhqk", q, k) / math.sqrt(q.shape[-1])
        seen = einsum("mhqk,mhkd->mhqd", logits.softmax(-1), v)
        return self.linear(seen.transpose(1, 2).flatten(1), f"{name}.fc_out")

    def linear(self, x, name):
        return F.linear(x, self.weights[f"{name}.weight"], self.weights[f"{name}.bias"])

    def norm(self, x, name):
        return F.layer_norm(x, x.shape[-1:], self.weights[f"{name}.weight"], self.weights[f"{name}.bias"], 1e-5)


def encoded(x):
    """x [M, w] → [sin 2πfx | sin(2πfx + π/2) | x] [M, 5w], frequencies 1 and 4, the frequency varying fastest."""
    frequencies = torch.tensor([1.0, 4.0], dtype=x.dtype)
    waves = (2 * math.pi * x[..., None] * frequencies).flatten(1)
    return torch.cat([torch.sin(torch.cat([waves, waves + math.pi / 2], -1)), x], -1)
