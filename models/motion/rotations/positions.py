"""How the people stand to one another across a cut: a witness of the camera's rotation that no pose of a body bends.

Whoever is on both sides of a cut stands where he stood. The horizontal lines from person to person before and after it,
levelled by each shot's own vertical, therefore differ by the camera's rotation about the vertical alone.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.motion.rotations.levelling import ShotVertical, level_axes
from humanmm.models.motion.rotations.rotation_mixtures import RotationEdge, RotationHypothesis
from humanmm.models.motion.rotations.shot_results import ShotResults, camera_of, motions_of
from humanmm.models.records.motion import PersonShotMotion

Array = np.ndarray

NEAR_S = 0.2
"""Positions at a cut are means over so much time beside it; who is not seen within twice of that has none."""
DEPTH_ERROR = 0.07
"""Standard deviation of a person's distance from the camera, as a fraction of it."""
MOVED_MS = 0.44
"""How fast people move in the meantime, root mean square along an axis: the line between two who dance, fight or walk
changes by √2 times as much (25 pairs of 27 rendered clips: 0.10 m after 0.1 s, 0.62 after 1 s, 1.6 after 3 s)."""
LEAST_SIGMA_DEG = 12.0
"""People move while nobody films, and the axis of the body is not the place where it stands."""
MOST_SIGMA_DEG = 40.0
"""People who stand so close together, or so far away, say nothing."""
RIGHT, SWAPPED = 0.85, 0.06
"""Probability that positions are right if identities are; that two people have swapped identities."""
LEAST_IDENTITY = 0.6
"""The positions of a person whose identity is less probable than this are not used."""
SPREAD_ERROR = 0.5
"""Logarithm of the ratio of the distances between people before and after a cut at which the positions are half as
likely to be theirs."""


def position_edge(
    results: ShotResults,
    earlier: int,
    later: int,
    verticals: Mapping[int, ShotVertical],
    identities: Mapping[tuple[int, int], float],
) -> RotationEdge | None:
    """What the places of all people on both sides of the cut between two shots say of the rotation between the shots.

    `identities`: by person and shot, the probability that he is who he is said to be; 1 where it is not named. None
    where fewer than two are seen near the cut, or they stand too close together.
    """
    before, after = motions_of(results, earlier), motions_of(results, later)
    certain = results.certain
    places, right = [], RIGHT
    for person in sorted(before.keys() & after.keys() & certain):
        identity = identities.get((person, later), 1.0)
        a = _at_cut(results, earlier, before[person], last=True)
        b = _at_cut(results, later, after[person], last=False)
        if identity >= LEAST_IDENTITY and a is not None and b is not None:
            places.append((a, b))
            right = min(right, RIGHT * identity)
    if len(places) < 2:
        return None
    upright = verticals[earlier].upright, verticals[later].upright
    level = [level_axes(one.direction) for one in upright]
    a, b = (np.stack(points) @ R for points, R in zip(zip(*places, strict=True), level, strict=True))
    depth = 0.5 * (np.linalg.norm(a, axis=1).mean() + np.linalg.norm(b, axis=1).mean())
    a, b = (points[:, :2] - points[:, :2].mean(axis=0) for points in (a, b))
    # Horizontal Procrustes: the heading about the vertical that carries b to a.
    heading = np.arctan2((b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]).sum(), (a * b).sum())
    spread_a, spread_b = (max(float(np.sqrt((points**2).sum() / len(places))), 1e-6) for points in (a, b))
    right /= 1 + (np.log(spread_a / spread_b) / SPREAD_ERROR) ** 2
    between_s = results.time_s[camera_of(results, later).start] - results.time_s[camera_of(results, earlier).end - 1]
    of_places = np.hypot(DEPTH_ERROR * depth, MOVED_MS * between_s)
    of_lines = np.degrees(np.arctan2(of_places, np.sqrt(spread_a * spread_b)))
    sigma_deg = float(np.linalg.norm([LEAST_SIGMA_DEG, of_lines, *(one.sigma_deg for one in upright)]))
    if sigma_deg > MOST_SIGMA_DEG:
        return None

    def hypothesis(angle: float, probability: float, source: str) -> RotationHypothesis:
        R = level[0] @ rotvec_to_rotmat(np.array([0.0, 0.0, angle])) @ level[1].T
        return RotationHypothesis(R, sigma_deg, probability, source)

    hypotheses = [hypothesis(float(heading), right, "positions")]
    if len(places) == 2:
        hypotheses.append(hypothesis(float(heading + np.pi), SWAPPED, "positions, identities swapped"))
    return RotationEdge(earlier, later, tuple(hypotheses), "positions", connects=False)


def _at_cut(results: ShotResults, shot: int, motion: PersonShotMotion, *, last: bool) -> Float[Array, "3"] | None:
    """Where a person's pelvis is at a shot's end or start: shot axes about the camera at the cut, metres."""
    camera = camera_of(results, shot)
    end = camera.end - 1 if last else camera.start
    away = np.abs(results.time_s[motion.frame] - results.time_s[end])
    near = (away <= max(float(away.min()), NEAR_S)) & motion.observed
    if not near.any() or away[near].min() > 2 * NEAR_S:
        return None
    rows = motion.frame[near] - camera.start
    in_axes = np.einsum("nab,nb->na", camera.R_shot_cam[rows], motion.pelvis_cam[near])
    return np.asarray(in_axes.mean(axis=0))
