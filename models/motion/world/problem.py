"""What is known before the solve: people in front of cameras, the cameras' paths, what ties cameras to one another."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int

Array = np.ndarray

HOLE_S = 0.1
"""Frames of a track further apart than this have a hole between them, unless frames of the video are as far apart:
what somebody did meanwhile nobody saw."""


@dataclass(frozen=True)
class ShotTrajectory:
    """One person in one shot: n observed frames. World axes already, up to the small rotations to be found."""

    person: int
    shot: int
    frame: Int[Array, "n"]
    time_s: Float[Array, "n"]
    offset: Float[Array, "n 3"]
    """Pelvis from the camera's centre, metres, world axes."""
    feet: Float[Array, "n 4 3"]
    """Sole points (left heel, left toes, right heel, right toes) from the pelvis, metres, world axes."""
    weight: Float[Array, "n"]
    """Trust in the observation, 0..1."""
    ahead: Float[Array, "n 3"]
    """Where the camera looks, unit vectors, world axes."""
    size_known: bool = False
    """Whether the user gave the person's height."""

    @property
    def step_s(self) -> float:
        """From frame to frame, seconds; 1 of a single one."""
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 1.0

    @property
    def hole_s(self) -> float:
        """Over a longer time between two of its frames nobody saw what the person did, seconds."""
        if len(self.time_s) < 2:
            return HOLE_S
        frame_s = float(np.median(np.diff(self.time_s) / np.diff(self.frame)))
        return max(HOLE_S, 1.5 * frame_s)

    def grown(self, factor: float) -> "ShotTrajectory":
        """The trajectory of the same picture if the person is so many times as large: as many times as far away."""
        return replace(self, offset=factor * self.offset, feet=factor * self.feet)

    def seen_through(self, log_focal: float) -> "ShotTrajectory":
        """The trajectory of the same picture with another lens: with a longer one everybody is as far to the side, and
        farther away. `log_focal`: logarithm of how many times as long it is."""
        depth = np.sum(self.offset * self.ahead, axis=1, keepdims=True)
        return replace(self, offset=self.offset + np.expm1(log_focal) * depth * self.ahead)


@dataclass(frozen=True)
class ShotRig:
    """One shot's camera in world axes."""

    path: Float[Array, "F 3"]
    """Camera centre of each frame from the shot's origin, world axes, in the camera's own unit."""
    start: int
    scale: float
    """Metres per unit of `path`."""
    scale_known: bool
    level_deg: float = math.inf
    """Standard deviation of its vertical by its own evidence."""
    up: Float[Array, "3"] = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """Where its own evidence has the vertical: a unit vector, world axes."""
    scenery: Float[Array, "p 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    """Points of the background, in the axes and the unit of `path`."""
    relative_std: Float[Array, " p"] = field(default_factory=lambda: np.zeros(0))
    """Standard deviation of their distance from the camera, as a fraction of it."""


@dataclass(frozen=True)
class CameraEdge:
    """Two shots whose rotation against each other is known."""

    a: int
    b: int
    sigma_deg: float


@dataclass(frozen=True)
class SameCamera:
    """Two frames of different shots taken by one static camera."""

    shot_a: int
    frame_a: int
    shot_b: int
    frame_b: int
