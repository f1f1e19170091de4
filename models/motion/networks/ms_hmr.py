"""ms-HMR (paper section 3.3.2): a temporal transformer over all shots of a video, which knows where a shot ends.

Each shot's pose carries an error of its own, which lasts as long as the shot; the same motion goes on in the next one,
seen from elsewhere. The encoder sees both sides of a cut and says how each frame's joints are off: θ → φ, and the
residual of Γ. Its positions are the frames' times (rotary) and the shots' indices (sinusoids added to the tokens).
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from humanmm.models.motion.networks.sequence import (
    JOINTS,
    PATH_FEATURES,
    POSE_FEATURES,
    RATE_HZ,
    MotionSequence,
    product,
)
from humanmm.models.perception.lifting.network import Block, rotary, rotations_of

REACH_S = 1.01
"""Frames farther apart do not see each other in one layer."""
DROPOUT = 0.1
"""In training."""
SHOT_PERIODS = 64
"""Longest period of the encoding of a shot's index."""


@dataclass(frozen=True)
class PoseCorrection:
    """Of every frame."""

    rotations: Tensor
    """(B,n,20,3,3): corrected; the root's in the world."""
    log_sigma: Tensor
    """(B,n,20): logarithm of their expected errors, radians."""


class MsHmr(nn.Module):
    """See the module."""

    def __init__(self, width: int = 160, depth: int = 4, heads: int = 5) -> None:
        super().__init__()
        features = POSE_FEATURES + PATH_FEATURES
        self.inward = nn.Sequential(nn.Linear(features, 2 * width), nn.GELU(), nn.Linear(2 * width, width))
        self.blocks = nn.ModuleList(Block(width, heads, DROPOUT) for _ in range(depth))
        self.norm = nn.LayerNorm(width)
        self.outward = nn.Linear(width, JOINTS * 7)
        nn.init.zeros_(self.outward.weight)
        nn.init.zeros_(self.outward.bias)
        self.register_buffer("no_rotation", torch.tensor([1.0, 0, 0, 0, 1, 0]), persistent=False)

    @property
    def reach_s(self) -> float:
        """How far from a frame lies what it depends on."""
        return len(self.blocks) * REACH_S

    def forward(self, motion: MotionSequence) -> PoseCorrection:
        """The motion corrected; residuals are in each joint's own axes: R ← R ΔR."""
        h = self.inward(torch.cat([motion.pose_features(), motion.path_features()], dim=-1))
        h = h + shot_encoding(motion.shot, h.shape[-1])
        n = h.shape[1]
        time_s = torch.arange(n, device=h.device) / RATE_HZ
        turning = rotary(time_s.expand(h.shape[0], n), h.shape[-1] // self.blocks[0].heads)
        near = ((time_s[:, None] - time_s).abs() <= REACH_S)[None, None]
        for block in self.blocks:
            h = block(h, turning, near)
        raw = self.outward(self.norm(h)).unflatten(-1, (JOINTS, 7))
        delta = rotations_of(raw[..., :6] + self.no_rotation)
        return PoseCorrection(product(motion.rotations, delta), raw[..., 6] - 1.5)


def shot_encoding(shot: Tensor, width: int) -> Tensor:
    """(B,n) → (B,n,width): sinusoids of the shot's index, periods from 2 to SHOT_PERIODS shots."""
    count = width // 2
    periods = torch.exp(torch.linspace(math.log(2.0), math.log(SHOT_PERIODS), count, device=shot.device))
    phase = 2 * math.pi * shot[..., None] / periods
    return torch.cat([torch.sin(phase), torch.cos(phase)], dim=-1)
