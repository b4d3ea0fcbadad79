"""One training step: encode, sample, decode, losses, backward, clip, Adam."""

import math
from dataclasses import dataclass

import torch

import losses


@dataclass
class Batch:
    """What a step works on, prepared beforehand."""

    directions: torch.Tensor  # of the encoder's samples [B, T, P, 3]
    log_radiance: torch.Tensor  # there [B, T, P, 3]
    loss_directions: torch.Tensor  # [R, 3]
    target: torch.Tensor  # log radiance [B, rows, columns, 3]
    noise: torch.Tensor  # [B, N, 3]

    def to(self, kind):
        return Batch(*(tensor.to(kind) for tensor in vars(self).values()))


def draw_batch(sizes, seed=0):
    """Directions as a run has them; radiance is noise with the spread of a sky."""
    generator = torch.Generator().manual_seed(seed)

    def normal(*shape):
        return torch.randn(*shape, generator=generator)

    b, (rows, columns) = sizes.batch, sizes.loss_size
    directions = torch.nn.functional.normalize(normal(b, sizes.stripes, sizes.samples, 3), dim=-1)
    log_radiance = 1.5 * normal(b, sizes.stripes, sizes.samples, 1) + 0.2 * normal(b, sizes.stripes, sizes.samples, 3)
    target = 1.5 * normal(b, rows, columns, 1) + 0.2 * normal(b, rows, columns, 3)
    return Batch(directions, log_radiance, panorama_directions(rows, columns), target, normal(b, sizes.latent_vectors, 3))


def panorama_directions(rows, columns, kind=torch.float32):
    """Of the pixels of an equirectangular panorama, row 0 up, the centre along +x: [rows · columns, 3]."""
    theta = math.pi * (torch.arange(rows, dtype=torch.float64) + 0.5)[:, None] / rows
    phi = math.pi - 2 * math.pi * (torch.arange(columns, dtype=torch.float64) + 0.5)[None] / columns
    parts = theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos().expand(-1, columns)
    return torch.stack(parts, -1).flatten(0, 1).to(kind)


class Loss:
    """The weighted losses of a batch by name."""

    def __init__(self, sizes, kind=torch.float32, mixed=False):
        self.weight, self.mixed = sizes.losses["kld"], mixed
        self.image = losses.FORMS[sizes.form](sizes, kind)

    def __call__(self, graph, batch):
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=self.mixed):
            mean, log_variance = graph.encode(batch.directions, batch.log_radiance)
            latent = mean + (0.5 * log_variance).exp() * batch.noise
            decoded = graph.decode(latent, batch.loss_directions).reshape(batch.target.shape)
        if self.mixed:
            mean, log_variance, decoded = mean.float(), log_variance.float(), decoded.float()
        return {**self.image(decoded, batch.target), "kld": self.weight * losses.kld(mean, log_variance)}


class Optimiser:
    """Adam (PyTorch's fused kernel) on two groups, clipped each by its own norm, and an average of the weights."""

    def __init__(self, graph, sizes):
        self.sizes, self.updates = sizes, 0
        self.groups = graph.groups()
        self.rates = [sizes.decoder_rate, sizes.encoder_rate]
        groups = [{"params": g, "weight_decay": r.weight_decay} for g, r in zip(self.groups, self.rates)]
        self.adam = torch.optim.AdamW(groups, lr=0.0, betas=(0.9, 0.999), eps=1e-8, fused=True)
        self.weights = [w for group in self.groups for w in group]
        self.average = [w.detach().clone() for w in self.weights] if sizes.ema_decay else []

    def zero(self):
        self.adam.zero_grad(set_to_none=True)

    def step(self):
        """Update number 1, 2, …; schedules count from 0."""
        for group, rate, weights in zip(self.adam.param_groups, self.rates, self.groups):
            torch.nn.utils.clip_grad_norm_(weights, self.sizes.clip)
            group["lr"] = learning_rate(rate, self.updates)
        self.adam.step()
        self.updates += 1
        if self.average:
            decay = min(self.sizes.ema_decay, self.updates / (self.updates + 9))
            torch.optim.swa_utils.get_ema_multi_avg_fn(decay)(self.average, self.weights, self.updates)


def learning_rate(rate, step):
    if step < rate.warm_up:
        return rate.rate * step / rate.warm_up
    along = min((step - rate.warm_up) / (rate.steps - rate.warm_up), 1.0)
    return rate.rate * (rate.floor + (1 - rate.floor) * 0.5 * (1 + math.cos(math.pi * along)))
