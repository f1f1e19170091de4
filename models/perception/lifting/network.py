"""The lifter's network.

A temporal transformer over the frames of one person in one shot. Its positions are the frames' times (rotary embedding:
Su et al. 2021); its attention reaches a second, so that the cost grows linearly with a video's length. What
a pose network says of landmarks in space is an input like the others: it may be missing.
"""

import functools
import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Self

import torch
from torch import Tensor, nn

from humanmm.models.body.body24 import ROTATED_JOINTS
from humanmm.models.records.landmarks import NUM_LANDMARKS

JOINTS = len(ROTATED_JOINTS)
"""The root and the joints whose rotation can be seen."""
REACH_S = 1.01
"""Frames farther apart than this do not see each other (a little more than a second, which is a multiple of many frame
intervals: rounding would decide)."""
FASTEST_S, SLOWEST_S = 0.03, 8.0
"""Shortest and longest wavelength of the rotary embedding, about."""


@dataclass(frozen=True, eq=False)
class Tensors:
    """Fields that are all tensors, or records of tensors."""

    def to(self, device: str) -> Self:
        """The same on another device."""
        return replace(self, **{name: value.to(device) for name, value in vars(self).items()})


@dataclass(frozen=True)
class LifterInput(Tensors):
    """One person's frames, B people or windows of n frames; axes of each frame's viewing ray (x right, y down, z away).

    Numbers of what is not there are zero.
    """

    time_s: Tensor
    """(B,n)."""
    exists: Tensor
    """(B,n) bool: frames in which the person was seen."""
    points: Tensor
    """(B,n,33,2): keypoints about the ray, in units of the crop's side."""
    certainty: Tensor
    """(B,n,33): 0..1, how sure keypoints are (`features.certainty_of`); 0 for those that nobody gave."""
    landmarks: Tensor
    """(B,n,33,3): the pose network's, metres about the mid-hip."""
    has_landmarks: Tensor
    """(B,n) bool."""
    size: Tensor
    """(B,n): the crop's side, seen from the camera (side over focal length)."""

    def features(self) -> Tensor:
        """(B,n,c): what the network reads."""
        seen = (self.certainty > 0).to(self.points.dtype)
        has = self.has_landmarks[..., None].to(self.points.dtype)
        parts = [
            (self.points * seen[..., None]).flatten(2),
            self.certainty,
            (self.landmarks * has[..., None]).flatten(2),
            has,
            torch.log(self.size.clamp_min(1e-3))[..., None] + 1.0,
        ]
        return torch.cat(parts, dim=-1)


FEATURES = NUM_LANDMARKS * 6 + 1 + 1


@dataclass(frozen=True)
class LifterOutput:
    """Of every frame."""

    landmarks: Tensor
    """(B,n,33,3): metres about the mid-hip, view axes."""
    pose: Tensor
    """(B,n,20,3,3): rotations of the root (view axes) and of the joints that a fit rotates (to their parents)."""
    pose_log_sigma: Tensor
    """(B,n,20): logarithm of their expected errors, radians."""
    swapped: Tensor
    """(B,n): log-odds that left and right of the keypoints are swapped."""
    contacts: Tensor
    """(B,n,4): log-odds of ankles and toes standing."""


_PARTS = (NUM_LANDMARKS * 3, JOINTS * 6, JOINTS, 1, 4)


class LifterNetwork(nn.Module):
    """See the module."""

    def __init__(self, width: int = 192, depth: int = 10, heads: int = 6, *, dropout: float = 0.0) -> None:
        super().__init__()
        self._block = functools.partial(Block, width, heads, dropout)
        self.heads = heads
        self.inward = nn.Sequential(nn.Linear(FEATURES, 2 * width), nn.GELU(), nn.Linear(2 * width, width))
        self.blocks = nn.ModuleList(self._block() for _ in range(depth))
        self.norm = nn.LayerNorm(width)
        self.outward = nn.Linear(width, sum(_PARTS))
        nn.init.zeros_(self.outward.weight)
        nn.init.zeros_(self.outward.bias)
        self.mean = nn.Parameter(torch.zeros(NUM_LANDMARKS, 3))
        self.mean_pose = nn.Parameter(torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(JOINTS, 1))

    @classmethod
    def shaped_as(cls, numbers: Mapping[str, Tensor]) -> Self:
        """An untrained network as deep as the one with these numbers."""
        return cls(depth=len({name.split(".")[1] for name in numbers if name.startswith("blocks.")}))

    def deepened(self, depth: int) -> Self:
        """A network of so many blocks that says what this one says: new ones, each before an old one, begin silent."""
        deeper, old = deepcopy(self), len(self.blocks)
        places = {(k + 1) * depth // old - 1: block for k, block in enumerate(deeper.blocks)}
        deeper.blocks = nn.ModuleList(places[k] if k in places else self._block().silent() for k in range(depth))
        return deeper

    def forget_landmarks(self) -> None:
        """Give 3D landmarks no say: to a network that has never seen any they say nothing."""
        first_of_landmarks = 3 * NUM_LANDMARKS
        with torch.no_grad():
            next(self.inward.parameters())[:, first_of_landmarks : FEATURES - 1] = 0.0

    @property
    def reach_s(self) -> float:
        """How far from a frame lies what it depends on."""
        return len(self.blocks) * REACH_S

    def hidden_matrices(self) -> list[nn.Parameter]:
        """Weights from features to features, without those of the last layer."""
        return [weight for part in (self.inward, self.blocks) for weight in part.parameters() if weight.ndim == 2]

    def forward(self, given: LifterInput) -> LifterOutput:
        """What is there in every frame."""
        features = given.features()
        whole = functools.partial(torch.autocast, features.device.type, enabled=False)
        with whole():  # a training may multiply in bfloat16: features and metres have more digits than that
            h = self.inward(features)
        turning = rotary(given.time_s, h.shape[-1] // self.heads)
        near = (given.time_s[:, :, None] - given.time_s[:, None]).abs() <= REACH_S
        mask = (near & given.exists[:, None]) | torch.eye(near.shape[1], dtype=torch.bool, device=near.device)
        for block in self.blocks:
            h = block(h, turning, mask[:, None])
        with whole():
            raw = self.outward(self.norm(h))
        landmarks, pose, pose_log_sigma, swapped, contacts = raw.split(_PARTS, dim=-1)
        return LifterOutput(
            self.mean + landmarks.unflatten(-1, (NUM_LANDMARKS, 3)),
            rotations_of(pose.unflatten(-1, (JOINTS, 6)) + self.mean_pose),
            pose_log_sigma - 1.5,
            swapped[..., 0] - 3.0,
            contacts,
        )


def rotations_of(six: Tensor) -> Tensor:
    """(…,6) → (…,3,3): two columns made orthonormal (Zhou et al. 2019)."""
    a, b = six[..., :3], six[..., 3:]
    x = nn.functional.normalize(a, dim=-1)
    y = nn.functional.normalize(b - (x * b).sum(-1, keepdim=True) * x, dim=-1)
    return torch.stack([x, y, torch.linalg.cross(x, y)], dim=-1)


class Block(nn.Module):
    """Attention and a perceptron, normalised before (Xiong et al. 2020), over frames with rotary positions."""

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads = heads
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.qkv, self.out = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.mlp = nn.Sequential(nn.Linear(width, 3 * width), nn.GELU(), nn.Linear(3 * width, width))
        self.dropout = nn.Dropout(dropout)

    def silent(self) -> Self:
        """Itself, with last weights that let it return what it is given."""
        for last in (self.out, self.mlp[-1]):
            for numbers in last.parameters():
                nn.init.zeros_(numbers)
        return self

    def forward(self, h: Tensor, positions: tuple[Tensor, Tensor], mask: Tensor) -> Tensor:
        """(B,n,width) to the same; `positions` by `rotary`, `mask` true where a frame sees another."""
        B, n, width = h.shape
        q, k, v = self.qkv(self.norm1(h)).reshape(B, n, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        q, k = _rotated(q, positions), _rotated(k, positions)
        attended = nn.functional.scaled_dot_product_attention(q, k, v, attn_mask=mask)
        h = h + self.dropout(self.out(attended.transpose(1, 2).reshape(B, n, width)))
        h = h + self.dropout(self.mlp(self.norm2(h)))
        return torch.as_tensor(h)


def rotary(time_s: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """Cosines and sines (B,1,n,size/2) of each frame's phase."""
    count = size // 2
    wavelength = torch.exp(torch.linspace(math.log(FASTEST_S * 4), math.log(SLOWEST_S), count, device=time_s.device))
    phase = 2 * math.pi * time_s[:, None, :, None] / wavelength
    return torch.cos(phase), torch.sin(phase)


def _rotated(x: Tensor, positions: tuple[Tensor, Tensor]) -> Tensor:
    c, s = positions
    a, b = x.chunk(2, dim=-1)
    return torch.cat([a * c - b * s, a * s + b * c], dim=-1)
