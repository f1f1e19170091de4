"""The unknowns of the world's solve, and how far its errors are expected to go."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.motion.world.problem import ShotTrajectory

Array = np.ndarray


DENSE_S = 1 / 30
"""Frames nearer to one another say no more of motion together than frames so far apart do: they count by time."""


@dataclass(frozen=True)
class SolveSettings:
    """Standard deviations of what ties the world together, as measured on fits to rendered people."""

    across_m: float = 0.02
    """Error of the pelvis across the line of sight."""
    across_step_m: float = 0.006
    """By how much that error changes in 1/30 s, in t seconds by the root of 30 t: 0.004 m (root mean square, an axis)
    in 1/30 s, 0.011 in 4/30 s, 0.024 in half a second on 21 people of twelve development clips."""
    depth_fraction: float = 0.02
    """Error of the pelvis along the line of sight that changes within a shot, as a fraction of the distance."""
    taller_std: float = 0.07
    smaller_std: float = 0.12
    """Of the logarithm of a person's size, which all his distances go by: the bones that a pose network sees say little
    about it. Somebody may be a child."""
    known_size_std: float = 0.01
    """The same of somebody whose height is known."""
    mean_size_std: float = 0.003
    """The same of all together, by how long they are seen, if nobody's height is known: speeds and accelerations are
    least in a world that is shrunk, and would shrink everybody (with 0.01 by up to 6 %)."""
    correlation_s: float = 0.4
    """Errors of observations change this slowly."""
    still_ms: float = 0.15
    """Speed of a foot that stands still across the line of sight, with the noise of the fitted leg."""
    still_along_ms: float = 0.5
    """The same along the line of sight."""
    swing_fraction: float = 1.0
    """The same, as a fraction of the speed with which somebody comes or goes: fitted legs swing in depth by 0.4 to 0.7
    of what they should (median), all points of both feet alike."""
    moving: float = 2.0
    """A foot certainly moves that is so many times as fast."""
    floor_m: float = 0.06
    """Height of a sole point that bears the body; the four points of a body err together."""
    acceleration_ms2: float = 6.0
    level_deg: float = 4.0
    """Error of a shot's vertical before the solve, where its own evidence claims no less."""
    heading_trust: float = 2.0
    """How many times as certain of its heading a shot is held to be: feet and paths of people who spin or roll on the
    floor are mostly wrong. With 1 cameras of clips in which people walk turn less wrongly (5.9 instead of 6.2° in the
    mean), those of acrobats more."""
    floor_scale_reach: float = 3.0
    """Standard deviations from which the scale that the floor gives counts less (the scale of a Cauchy kernel)."""
    log_scale_std: float = 0.15
    """Error of the logarithm of a path's scale besides what the solve knows of: paths have errors of their own shape
    (see docs/measurements/world.md)."""
    iterations: int = 30
    """At most: most clips take nine, hard ones (whose feet stand and do not) are 0.2 m from the end after twelve."""
    converged_m: float = 3e-4
    """Nobody moves further in the last step, metres: what is left to go is below a millimetre."""


@dataclass(frozen=True)
class WorldState:
    """What the solve changes; N_k frames of trajectory k, in the order in which it was given; S shots, P people.

    World axes (z up, floor at z = 0 once feet are put on it), metres.
    """

    pelvis: list[Float[Array, "N_k 3"]]
    """Positions, one array a trajectory."""
    rotation: Float[Array, "S 3 3"]
    """Small rotation of each shot: turns what `ShotTrajectory` and `ShotRig` have in world axes, from the left."""
    origin: Float[Array, "S 3"]
    """Where each shot's path begins."""
    scale: Float[Array, " S"]
    """Metres per unit of each shot's path."""
    log_size: Float[Array, " P"]
    """Per person, in order of their numbers: logarithm of how much larger he is than `ShotTrajectory` has him."""
    log_focal: float
    """Logarithm of how much longer the focal length is than that of `ShotTrajectory`."""

    def ordered(self, order: Sequence[int]) -> "WorldState":
        """The same with the trajectories in another order."""
        return replace(self, pelvis=[self.pelvis[k] for k in order])


def as_solved(trajectories: Sequence[ShotTrajectory], state: "WorldState") -> list[ShotTrajectory]:
    """The trajectories with the sizes and the focal length of a state."""
    size = dict(zip(people_of(trajectories), np.exp(state.log_size).tolist(), strict=True))
    return [one.seen_through(state.log_focal).grown(size[one.person]) for one in trajectories]


def people_of(trajectories: Sequence[ShotTrajectory]) -> list[int]:
    """Everybody's number, in order."""
    return sorted({trajectory.person for trajectory in trajectories})
