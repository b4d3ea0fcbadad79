"""The training losses on log radiance [B, H, W, 3], in the form of the paper and in that of the reference implementation."""

import math

import torch
from torch.nn import functional as F

# Scharr's derivatives along a row and along a column
SCHARR = torch.tensor([[[-3.0, 0, 3], [-10, 0, 10], [-3, 0, 3]], [[-3, -10, -3], [0, 0, 0], [3, 10, 3]]])
# the reference implementation's pair, whose second entry sums to 20
REFERENCE = torch.tensor([[[-3.0, 0, 3], [-10, 0, 10], [-3, 0, 3]], [[-3, 10, -3], [0, 0, 0], [3, 10, 3]]])


def kld(mean, log_variance):
    """From N(0, 1) of isotropic Gaussians in R³: [B, N, 3] and [B, N, 1] → mean over batch and vectors."""
    square = mean.square().sum(-1, keepdim=True)
    return 0.5 * (square - 3 - 3 * log_variance + 3 * log_variance.exp()).mean()


class Corrected:
    """As the paper describes them: weights are solid angles at pixel centres, factors on the radiance are not seen."""

    def __init__(self, sizes, kind):
        height, _ = sizes.loss_size
        self.rows = solid_angle(height, kind)
        self.scharr = SCHARR.to(kind)[:, None]
        self.weights = sizes.losses

    def __call__(self, prediction, target):
        """Weighted terms by name."""
        return {name: w * getattr(self, name)(prediction, target) for name, w in self.weights.items() if name != "kld"}

    def mage(self, prediction, target):
        error = (prediction - target).permute(0, 3, 1, 2).flatten(0, 1)[:, None]
        total = 0
        for scale in range(2):
            coarse = F.avg_pool2d(error, 2**scale) if scale else error
            # columns wrap around; rows at the poles, where the stencil does not fit, are left out
            wrapped = torch.cat([coarse[..., -1:], coarse, coarse[..., :1]], -1)
            edges = F.conv2d(wrapped, self.scharr).abs()
            inner = solid_angle(coarse.shape[2], error.dtype)[0, 1:-1, :, 0]
            total = total + (edges * (inner / inner.mean())).mean()
        return total / 2

    def scale_invariant(self, prediction, target):
        error = prediction - target
        mean = (error * self.rows).mean((1, 2, 3), keepdim=True)
        return ((error - mean).square() * self.rows).mean()

    def exposure(self, prediction, target):
        return ((prediction - target) * self.rows).mean((1, 2, 3)).square().mean()

    def cosine(self, prediction, target):
        """Of linear RGB, over its largest channel so that nothing overflows."""
        p, i = ((x - x.detach().amax(-1, keepdim=True)).exp() for x in (prediction, target))
        squares = p.square().sum(-1, keepdim=True) * i.square().sum(-1, keepdim=True)
        return ((1 - (p * i).sum(-1, keepdim=True) / squares.sqrt()) * self.rows).mean()

    def ldr_mse(self, prediction, target):
        """Of what is displayed: over the target's 98 % quantile, clamped, sRGB curve."""
        white = target.exp().flatten(1).quantile(0.98, 1).log()[:, None, None, None]
        difference = display(prediction - white) - display(target - white)
        return (difference.square() * self.rows).mean() / self.rows.mean()


class Reference:
    """As the reference implementation computes them: mask min(sin(πr/(H − 1)) + 0.001, 1) inside every term."""

    def __init__(self, sizes, kind):
        height, _ = sizes.loss_size
        sines = torch.sin(math.pi * torch.arange(height, dtype=torch.float64) / (height - 1))
        self.mask = (sines + 0.001).clamp_max(1).to(kind)[None, :, None, None]
        self.stencils = REFERENCE.to(kind)[:, None]
        self.weights = sizes.losses

    def __call__(self, prediction, target):
        """Weighted terms by name."""
        return {name: w * getattr(self, name)(prediction, target) for name, w in self.weights.items() if name != "kld"}

    def mage(self, prediction, target):
        # rows and columns change places
        p, i = ((x * self.mask).permute(0, 3, 2, 1).flatten(0, 1)[:, None] for x in (prediction, target))
        total = 0
        for _ in range(2):
            total = total + (F.conv2d(p, self.stencils) - F.conv2d(i, self.stencils)).abs().mean()
            p, i = p[..., ::2, ::2], i[..., ::2, ::2]
        return total / 2

    def scale_invariant(self, prediction, target):
        error = (prediction - target) * self.mask
        return (error.square().mean((1, 2)) - error.mean((1, 2)).square()).mean()

    def cosine(self, prediction, target):
        cosines = F.cosine_similarity(prediction, target, dim=-1, eps=1e-8)
        return (1 - cosines * self.mask[..., 0]).mean()

    def ldr_mse(self, prediction, target):
        """Which their program takes in log space."""
        return ((prediction - target) * self.mask).square().mean()


FORMS = {"corrected": Corrected, "reference": Reference}


def solid_angle(height, kind):
    """sin θ at pixel centres, of mean 1: [1, H, 1, 1]."""
    sines = torch.sin(math.pi * (torch.arange(height, dtype=torch.float64) + 0.5) / height)
    return (sines / sines.mean()).to(kind)[None, :, None, None]


def display(log_radiance):
    x = log_radiance.clamp_max(0).exp()
    return torch.where(x <= 0.0031308, 12.92 * x, 1.055 * x.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)
