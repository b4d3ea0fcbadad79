"""The two graphs, each with the same three members.

`weights` (name → leaf tensor), `encode(directions, log_radiance)` and `decode(latent, directions)`.
Directions and log radiance of the encoder are [B, T, P, 3], the mean [B, N, 3], the log variance [B, N, 1]; directions of
the decoder are [R, 3], shared by all panoramas, its log radiance [B, R, 3].
"""

from .reference import Reference
from .folded import Folded

GRAPHS = {"reference": Reference, "folded": Folded}
