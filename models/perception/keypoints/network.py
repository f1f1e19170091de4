"""The keypoint refiner's network: from what the pose networks' inner layers show about each landmark, where it is.

Every landmark is a token; what it sees of its surroundings is read by weights of its own, then the tokens look at one
another (a transformer encoder): an ankle knows better where it is if it knows where the knee is.
"""

from collections.abc import Mapping
from typing import NamedTuple, Self

import torch
from torch import Tensor, nn
from torch.nn import functional

from humanmm.models.perception.keypoints.surroundings import CHANNELS, COARSE_CHANNELS, COUNT, WINDOW

HEATS = 2
"""The last channels of a window, which need no weights to be read."""
NUMBERS = 13
READ, READ_COARSE = 16, 32
"""What a landmark's own weights read of a cell, and of its coarse cell."""
_PX = 6.0
"""A shift of one, pixels of the crop."""
SIGMA_PX = 4.0
"""An expected error of one."""


class RefinerInput(NamedTuple):
    """B crops; `surroundings.Seen` says what the parts are."""

    windows: Tensor
    """(B,22,7,7,74)."""
    coarse: Tensor
    """(B,22,96)."""
    numbers: Tensor
    """(B,22,13)."""


class KeypointRefiner(nn.Module):
    """See the module."""

    def __init__(self, width: int = 128, depth: int = 3, heads: int = 4, *, dropout: float = 0.0) -> None:
        super().__init__()
        self.unit = nn.Parameter(torch.ones(CHANNELS), requires_grad=False)
        """How large a channel of the windows is, about; so of the coarse cells."""
        self.coarse_unit = nn.Parameter(torch.ones(COARSE_CHANNELS), requires_grad=False)
        self.reading = nn.Parameter(0.12 * torch.randn(COUNT, CHANNELS, READ))
        self.coarse_reading = nn.Parameter(0.1 * torch.randn(COUNT, COARSE_CHANNELS, READ_COARSE))
        self.inward = nn.Linear(WINDOW**2 * (READ + HEATS) + READ_COARSE + NUMBERS, width)
        self.landmark = nn.Parameter(0.3 * torch.randn(COUNT, width))
        self.dropout = nn.Dropout(dropout)
        layer = nn.TransformerEncoderLayer(width, heads, 2 * width, dropout, batch_first=True, norm_first=True)
        self.encoder = nn.TransformerEncoder(layer, depth, enable_nested_tensor=False)
        self.outward = nn.Linear(width, 3)
        nn.init.zeros_(self.outward.weight)
        nn.init.zeros_(self.outward.bias)

    @classmethod
    def shaped_as(cls, numbers: Mapping[str, Tensor]) -> Self:
        """An untrained network as wide and deep as the one with these numbers."""
        depth = len({name.split(".")[2] for name in numbers if name.startswith("encoder.layers.")})
        return cls(numbers["landmark"].shape[1], depth)

    def forward(self, given: RefinerInput) -> tuple[Tensor, Tensor]:
        """Shift of each landmark (B,22,2), pixels of the crop, and its expected error after it (B,22), pixels."""
        windows = (given.windows / self.unit).flatten(2, 3)
        read = torch.einsum("bkgc,kcp->bkgp", windows, self.reading)
        coarse = torch.einsum("bkc,kcp->bkp", given.coarse / self.coarse_unit, self.coarse_reading)
        cells = torch.cat([read, windows[..., -HEATS:]], dim=-1).flatten(2)
        token = functional.relu(self.inward(self.dropout(torch.cat([cells, coarse, given.numbers], dim=-1))))
        out = self.outward(self.encoder(token + self.landmark)).float()
        return _PX * out[..., :2], SIGMA_PX * torch.exp(out[..., 2].clamp(-4, 4))
