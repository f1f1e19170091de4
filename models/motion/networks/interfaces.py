"""What motion networks take and return; `refine.networks` chooses them by name (docs/extend.md). Needs no torch."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float, Int

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class AlignedMotion:
    """One person in N frames over all shots, in one world: z up, metres."""

    rotations: Float[Array, "N 20 3 3"]
    """Of the root in the world, and of `body24.FREE_JOINTS` relative to their parents; float32."""
    pelvis: Float[Array, "N 3"]
    rest_joints: Float[Array, "24 3"]
    time_s: Float[Array, " N"]
    known: Bool[Array, " N"]
    """Where the person was seen; other frames hold what the neighbours say."""
    confidence: Float[Array, " N"]
    shot: Int[Array, " N"]
    """Index of each frame's shot."""


@dataclass(frozen=True, eq=False)
class Integrated:
    """What the networks say of these frames."""

    R_world_root: Float[Array, "N 3 3"]
    """The root's axes as the networks see them."""
    velocity: Float[Array, "N 3"]
    """Of the pelvis from each frame to the next, in these axes, m/s."""
    velocity_sigma: Float[Array, "N 3"]
    """Expected errors."""
    rotations: Float[Array, "N 20 3 3"] | None = None
    """Corrected, float32; None: as they are."""


class MotionNetworks(Protocol):
    """Reads how a body moves over all shots."""

    def __call__(self, motion: AlignedMotion) -> Integrated | None:
        """What is said of every frame; None: nothing."""
        ...


def nothing(motion: AlignedMotion) -> Integrated | None:
    """No network: the fit decides alone (`MotionNetworks`)."""
    del motion
    return None
