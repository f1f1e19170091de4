"""The scale of a moving camera's path: metres per unit, from the floor and from feet that stand still.

*The floor.* What people stand on is the lowest thing that the camera sees. Points of the background are placed in
space in the unit of the camera's path; how far below the camera somebody's soles are is known in metres. Under the
right scale many points lie on the level floor through the soles, most others above it, hardly any below it. One
likelihood of the scale (a mixture for each point that is seen below the horizon) has all three in it; points above the
horizon say only that the background is about as far away as people are, which keeps a path without any floor from
shrinking to nothing.

*Feet.* Under the right scale somebody's slower foot stands still most of the time.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from humanmm.models.geometry.robust import cauchy_loss
from humanmm.models.geometry.rotations import rotvec_to_rotmat, unit
from humanmm.models.motion.world.problem import ShotRig, ShotTrajectory

Array = np.ndarray

FEWEST_POINTS = 8
USABLE_STD = 0.5
"""Points whose distance is less certain than this fraction of it say nothing."""
EVIDENCE = 5.0
"""All points together count as so many independent ones: they share the errors of the path, the vertical and the
body. With it half of the errors of 55 rendered development shots are below 0.8, nine tenths below 2 stated standard
deviations."""
ON_FLOOR, BELOW_FLOOR = 0.4, 0.03
"""Fractions of the points below the horizon that are on the floor, and beyond it (pits, mirrors, wrong points)."""
BEFORE_FLOOR = 0.3
"""How far before the floor their rays end, mean of the logarithm, where something stands on it."""
FLOOR_STD = 0.1
"""Of the logarithm of a point's distance on the floor, besides its own error: soles are fitted, floors are uneven."""
LEVEL_DEG = 10.0
"""Standard deviation of a shot's vertical in the direction of view, where its own evidence claims no less."""
ROLL_RAD = np.deg2rad(2.0)
"""Error of the vertical to the sides."""
_PITCHES = (-1.8, -1.2, -0.6, 0.0, 0.6, 1.2, 1.8)
"""Errors of the vertical that are tried, standard deviations."""
FAR_MEAN, FAR_STD = 0.7, 0.8
"""Logarithm of the distance of points above the horizon over that of people (development set of rendered clips)."""
LEAST_SLOPE = 0.03
"""Sine of the angle below the horizon from which a ray meets the floor somewhere near."""
LEAST_HEIGHT_M = 0.15
"""A camera is no lower than this above somebody's soles."""
LOWEST_PERCENT = 15.0
"""Of the heights of somebody's lower sole, the one at which he stands."""
ENOUGH = 200
"""Frames of a person, or points, that are enough to determine a scale."""
_REACH, _STEP = (-5.0, 4.0), 0.1
"""Logarithms of the scales that are tried, about the one that puts half of the background behind people."""


@dataclass(frozen=True)
class LogScale:
    """A scale that is known: the logarithm of metres per unit of the path, and its standard deviation."""

    mean: float
    sigma: float


def scale_from_floor(rig: ShotRig, trajectories: Sequence[ShotTrajectory]) -> LogScale | None:
    """The scale of a shot's path by its background and the people in it (of this shot alone); None without either."""
    people = [trajectory for trajectory in trajectories if (trajectory.weight > 0).sum() >= FEWEST_POINTS]
    known = np.flatnonzero(rig.relative_std < USABLE_STD)
    if not people or len(known) < FEWEST_POINTS:
        return None
    known = _some(known)
    centre, level_rad = rig.path.mean(axis=0), np.deg2rad(min(rig.level_deg, LEVEL_DEG))
    ray, relative_std = rig.scenery[known] - centre, rig.relative_std[known]
    distance = np.linalg.norm(ray, axis=1)
    away = [np.linalg.norm(person.offset, axis=1) for person in people]
    log_scale = np.log(np.median(np.concatenate(away)) / np.median(distance)) + np.arange(*_REACH, _STEP)
    ahead = np.concatenate([person.offset for person in people]).mean(axis=0)
    pitch_axis = np.cross(unit(ahead), [0.0, 0.0, 1.0])
    ups = [rotvec_to_rotmat(off * level_rad * pitch_axis)[2] for off in _PITCHES]
    sights = [_Sight(distance, ray @ up / distance, relative_std) for up in ups]
    likelihoods = []
    for person, person_m in zip(people, away, strict=True):
        seen = _some(np.flatnonzero(person.weight > 0))
        path, log_trust = rig.path[person.frame[seen] - rig.start] - centre, np.log(person.weight.sum())
        for off, up, sight in zip(_PITCHES, ups, sights, strict=True):
            soles = person.offset[seen] @ up + (person.feet[seen] @ up).min(axis=1)
            floor = np.percentile(soles + np.exp(log_scale)[:, None] * (path @ up), LOWEST_PERCENT, axis=1)
            likely = sight.log_likelihood(log_scale, -floor, float(np.median(person_m)))
            likelihoods.append(likely + log_trust - 0.5 * off**2)
    log_posterior = np.logaddexp.reduce(likelihoods, axis=0)
    weight = np.exp(log_posterior - log_posterior.max())
    weight /= weight.sum()
    mean = float(weight @ log_scale)
    return LogScale(mean, float(np.sqrt(weight @ (log_scale - mean) ** 2 + _STEP**2 / 12)))


def _some(index: Int[Array, " n"]) -> Int[Array, " m"]:
    """All of a few, else ENOUGH to twice as many, spread evenly."""
    return np.asarray(index[:: max(1, len(index) // ENOUGH)])


@dataclass(frozen=True)
class _Sight:
    """Points about the middle of the camera's path: distance, sine of elevation, relative error of the distance."""

    distance: Float[Array, " p"]
    elevation: Float[Array, " p"]
    relative_std: Float[Array, " p"]

    def log_likelihood(
        self, log_scale: Float[Array, " s"], height_m: Float[Array, " s"], person_m: float
    ) -> Float[Array, " s"]:
        """Of scales, for each of which the camera is so high above the soles of somebody at `person_m`."""
        low = self.elevation < -LEAST_SLOPE
        slope = -self.elevation[low]
        to_floor = np.maximum(height_m, LEAST_HEIGHT_M)[:, None] / slope
        beyond = log_scale[:, None] + np.log(self.distance[low]) - np.log(to_floor)
        sigma = np.sqrt(self.relative_std[low] ** 2 + (ROLL_RAD / slope) ** 2 + FLOOR_STD**2)
        bell = np.exp(-0.5 * (beyond / sigma) ** 2)
        before = np.where(beyond < 0, np.exp(np.minimum(beyond, 0) / BEFORE_FLOOR), bell) / BEFORE_FLOOR
        density = (
            ON_FLOOR * bell / (sigma * np.sqrt(2 * np.pi))
            + (1 - ON_FLOOR - BELOW_FLOOR) * before
            + BELOW_FLOOR * np.exp(-np.abs(beyond) / 3) / 6
        )
        far = (log_scale[:, None] + np.log(self.distance[~low] / person_m) - FAR_MEAN) / FAR_STD
        total = np.log(density).sum(axis=1) - cauchy_loss(far**2).sum(axis=1)
        total *= min(1.0, EVIDENCE / len(self.distance))
        return np.asarray(np.where(height_m > LEAST_HEIGHT_M, total, total - 100.0))


def scale_from_feet(rig: ShotRig, trajectories: Sequence[ShotTrajectory]) -> float:
    """Metres per unit of a moving camera's path under which somebody's slower foot stands still most of the time.

    Only the motion across the line of sight is used, where depth errors do not reach. `trajectories`: of this shot.
    """
    costs, unit = [], 0.0
    candidates = np.zeros(0)
    velocity_path = np.diff(rig.path, axis=0)
    for trajectory in trajectories:
        own = _some(np.flatnonzero(np.diff(trajectory.frame) == 1))
        if len(own) < 2:
            continue
        step = np.diff(trajectory.time_s)[own, None]
        camera = velocity_path[trajectory.frame[own] - rig.start] / step
        unit = max(unit, float(np.median(np.linalg.norm(camera, axis=1))))
        if not len(candidates):
            if unit <= 0:
                return 1.0
            candidates = np.geomspace(0.02, 8.0, 60) / unit
        feet = trajectory.offset[:, None] + trajectory.feet
        velocity = np.diff(feet, axis=0)[own] / step[..., None]
        sight = trajectory.offset[own] / np.linalg.norm(trajectory.offset[own], axis=1, keepdims=True)
        total = velocity[None] + candidates[:, None, None, None] * camera[None, :, None]
        across = total - (total * sight[None, :, None]).sum(-1, keepdims=True) * sight[None, :, None]
        slowest = np.linalg.norm(across, axis=-1).min(axis=2)
        costs.append((slowest / (slowest + 0.3)).mean(axis=1))
    if not costs:
        return 1.0
    return float(candidates[int(np.sum(costs, axis=0).argmin())])
