"""What is trained: the sizes of the presets `tiny`, `small` and `paper` (crates/veni-core/src/train/presets/auto_encoder.rs)."""

from dataclasses import dataclass, field, replace

REFERENCE_LOSSES = {"mage": 0.5, "scale_invariant": 1.0, "cosine": 1.0, "kld": 0.01}
PAPER_LOSSES = {**REFERENCE_LOSSES, "exposure": 1.0}
SMALL_LOSSES = {**PAPER_LOSSES, "mage": 0.1, "cosine": 0.1, "kld": 0.02, "ldr_mse": 15.0}


@dataclass(frozen=True)
class Rate:
    """A warmed-up cosine from `rate` down to `floor` times it."""

    rate: float
    warm_up: int
    steps: int
    floor: float
    weight_decay: float = 0.0


@dataclass(frozen=True)
class Sizes:
    """Everything that decides what a training step computes."""

    latent_vectors: int
    batch: int
    width: int
    height: int
    # every `stride`-th pixel of every `stride`-th row enters the losses
    stride: int
    stripes: int
    samples: int
    channels: int
    depth: int
    heads: int
    head_channels: int
    expansion: int = 4
    hidden: int = 128
    layers: int = 6
    decoder_heads: int = 8
    # "corrected": VN-ReLUs project, losses as the paper describes them; "reference": both as in the reference implementation
    form: str = "corrected"
    losses: dict = field(default_factory=lambda: dict(PAPER_LOSSES))
    decoder_rate: Rate = Rate(1e-4, 200, 40_001, 0.05)
    encoder_rate: Rate = Rate(1e-3, 200, 40_001, 0.05)
    clip: float = 0.5
    ema_decay: float = 0.0

    @property
    def loss_size(self):
        """Rows and columns of the grid of the losses."""
        return self.height // self.stride, self.width // self.stride

    def reference(self):
        """The same network and weights as the reference implementation computes them."""
        kept = {name: weight for name, weight in self.losses.items() if name != "exposure"}
        return replace(self, form="reference", losses=kept)


PAPER = Sizes(
    latent_vectors=9, batch=5, width=128, height=64, stride=1,
    stripes=64, samples=512, channels=256, depth=6, heads=8, head_channels=32,
)
SMALL = replace(
    PAPER, batch=4, stride=2, samples=128, channels=96, depth=4, heads=6, head_channels=16, losses=SMALL_LOSSES,
    decoder_rate=Rate(1e-3, 200, 12_000, 0.01, weight_decay=0.01),
    encoder_rate=Rate(1e-3, 200, 12_000, 0.01, weight_decay=0.05), ema_decay=0.999,
)
TINY = replace(
    SMALL, batch=2, width=32, height=16, stride=1, stripes=16, samples=32, channels=16, depth=2, heads=2,
    head_channels=8, hidden=16, layers=2, decoder_heads=4,
    decoder_rate=Rate(3e-3, 10, 200, 0.05), encoder_rate=Rate(3e-3, 10, 200, 0.05), ema_decay=0.9,
)
PRESETS = {"tiny": TINY, "small": SMALL, "paper": PAPER}


def of(preset, latent_vectors, form="corrected"):
    """The sizes of a preset with N latent vectors, in either form."""
    sizes = replace(PRESETS[preset], latent_vectors=latent_vectors)
    return sizes.reference() if form == "reference" else sizes
