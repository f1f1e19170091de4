"""What floors say: two shots whose floors match, seen from above, differ by the heading that carries one to the other.

A room has four walls that may look alike, and people may be seen wrongly on one side of a cut; it has one floor, and
every camera sees it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from humanmm.models.camera.background.floor_views import (
    FloorFeatures,
    FloorMotion,
    floor_features,
    floor_motions,
    floor_rotation,
)
from humanmm.models.motion.rotations.levelling import level_axes
from humanmm.models.motion.rotations.rotation_mixtures import (
    COMPARE_ALL,
    QUANTILE_68,
    RotationEdge,
    RotationHypothesis,
    Upright,
    compared,
)
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of, motions_of
from humanmm.models.motion.rotations.standing import standing

EVIDENCE, ALIKE, EVEN = 2.75, 3.96, 5.12
"""A motion on which n matches agree and whose floors correlate by c has the odds n^EVIDENCE · exp(ALIKE · c − EVEN)
against none and against others."""
MOST_INLIERS, ONE_FLOOR = 30, 0.975
"""n counts up to MOST_INLIERS; ONE_FLOOR is the most that all motions of two floors have together. Fitted to 443 pairs
of shots of rendered clips (docs/measurements/cuts.md)."""
ALIKE_TILES = 0.1
"""Probability that floors which seem to match are a quarter or half of a turn off: tiles lie along the walls, so that
walls agree with them then. With 0, 0.05, 0.1 and 0.25 of it 67, 61, 61 and 63 rotations at 433 development cuts are
wrong by more than 30°, and 10, 5, 4 and 3 of these have a probability above 0.8 (docs/measurements/cuts.md)."""
LEAST_SIGMA_DEG = 1.5
"""68 % of right rotations are off by no less: lenses, floors that are not even."""
LEAST_TILT_DEG = 1.5
"""No vertical is so certain that a floor may not correct it."""
LEAST_PROBABILITY = 0.05
"""Headings that are less likely are not named."""
LOWEST_M = 0.2
"""A camera that stands lower sees no floor."""


@dataclass(frozen=True, eq=False)
class _SeenFloor:
    """The floor in one key frame."""

    height: float
    """Of the camera above it, metres."""
    features: FloorFeatures


@dataclass(frozen=True, eq=False)
class _Moved:
    """How the floor of one key frame lies in that of another."""

    a: _SeenFloor
    b: _SeenFloor
    motion: FloorMotion


def floor_edges(results: ShotResults, upright: Mapping[int, Upright]) -> list[RotationEdge]:
    """The headings between shots whose floors match; `upright`: by shot, where up is."""
    axes = {shot: level_axes(up.direction) for shot, up in upright.items()}
    # The floors of a shot take some megabytes: of a long video only those are held that are still compared.
    floors = lru_cache(maxsize=COMPARE_ALL)(lambda shot: _floors_of(results, shot, axes[shot]))
    edges = []
    for a, b in compared(sorted(axes)):
        hypotheses = tuple(
            _hypothesis(found, probability, (axes[a], axes[b]), (upright[a].sigma_deg, upright[b].sigma_deg))
            for found, probability in _likely(_motions(floors(a), floors(b)))
        )
        if hypotheses:
            edges.append(RotationEdge(a, b, hypotheses, "floors", connects=False, pooled=True))
    return edges


def _hypothesis(
    found: _Moved, probability: float, axes: tuple[np.ndarray, np.ndarray], sigmas_deg: tuple[float, float]
) -> RotationHypothesis:
    """What a motion of the floor says of two shots, whose level axes and the errors of whose verticals these are."""
    tilt_a, tilt_b = (math.radians(max(sigma, LEAST_TILT_DEG)) for sigma in sigmas_deg)
    R_a_b, sigma_rad = floor_rotation(found.motion, (found.a.height, found.b.height), (tilt_a, tilt_b))
    sigma_deg = math.hypot(LEAST_SIGMA_DEG, QUANTILE_68 * math.degrees(sigma_rad))
    return RotationHypothesis(axes[0] @ R_a_b @ axes[1].T, sigma_deg, probability, "floor")


def _floors_of(results: ShotResults, shot: int, axes: np.ndarray) -> list[_SeenFloor]:
    """The floor in a shot's key frames, in order of time; nothing where the camera's height is not known."""
    certain = results.certain
    people = [motion for motion in motions_of(results, shot).values() if motion.person in certain]
    if not people:
        return []
    longest = max(people, key=lambda motion: int(motion.observed.sum()))
    on_floor, camera = standing(results, shot, longest, axes), camera_of(results, shot)
    frames, heights = longest.frame[on_floor.feet_seen], -on_floor.floor[on_floor.feet_seen]
    if not len(frames):
        return []
    found = []
    pictures = results.pictures[shot]
    for picture in pictures[len(pictures) // 2 :][:1] if camera.stays else pictures:  # of that they all show one floor
        height, at = float(heights[np.abs(frames - picture.frame).argmin()]), picture.frame - camera.start
        if height >= LOWEST_M:
            R_level_cam = axes.T @ camera.R_shot_cam[at]
            features = floor_features(picture.gray, picture.in_picture(camera.K[at]), R_level_cam, height)
            found.extend([_SeenFloor(height, features)] if features is not None else [])
    return found


def _motions(a: Sequence[_SeenFloor], b: Sequence[_SeenFloor]) -> list[_Moved]:
    """The motions between three pairs of key frames: those next to each other in time, those farthest apart, and those
    in the middle; of motions that agree the one with most matches."""
    if not a or not b:
        return []
    pairs = {(len(a) - 1, 0), (0, len(b) - 1), (len(a) // 2, len(b) // 2)}
    found = [
        _Moved(one, other, motion)
        for one, other in ((a[k], b[m]) for k, m in sorted(pairs))
        for motion in floor_motions(one.features, other.features)
    ]
    distinct: list[_Moved] = []
    for one in sorted(found, key=lambda moved: -moved.motion.num_inliers):
        if not any(one.motion.is_like(other.motion) for other in distinct):
            distinct.append(one)
    return distinct


def _likely(found: Sequence[_Moved]) -> list[tuple[_Moved, float]]:
    """The motions with their probabilities, as far as these are worth naming."""
    odds = [
        min(one.motion.num_inliers, MOST_INLIERS) ** EVIDENCE * math.exp(ALIKE * one.motion.correlation - EVEN)
        for one in found
    ]
    likely = [(one, ONE_FLOOR * odd / (1 + sum(odds))) for one, odd in zip(found, odds, strict=True)]
    return [(one, probability) for one, probability in likely if probability >= LEAST_PROBABILITY]
