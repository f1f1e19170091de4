"""Which shots show the same background, and the relative poses of their cameras (see `frame_edges`).

Neighbouring shots are always compared. Any two shots are compared in short videos; in long ones only where a quick look
at their strongest features finds enough of them in common, so that the cost grows with the number of shots and not with
its square times the cost of a full comparison.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.background.frame_edges import (
    MIN_MATCHES,
    FrameEdge,
    ViewHypothesis,
    find_frame_edge,
    match_features,
)
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.geometry.rotations import rotation_angle

COMPARE_ALL = 8
"""Up to so many shots, any two are compared in full."""
REACH = 40
"""In longer videos a shot is compared with so many before it."""
QUICK_FEATURES = 400
FULL_COMPARISONS = 3
"""Pairs of key frames of two shots that are compared in full: those that look most alike at a quick look."""
LEAST_DEG, INLIER_DEG = 3.0, 300.0
"""Error of a rotation from many inliers, and from one; n of them leave one n-th of it open."""


@dataclass(frozen=True)
class ShotEdge:
    """What the background says of the cameras of two shots, at up to FULL_COMPARISONS pairs of their key frames."""

    shot_a: int
    shot_b: int
    frames: tuple[FrameEdge, ...]


def find_shot_edges(
    key_frames: Sequence[Sequence[FrameFeatures]], *, K: Float[np.ndarray, "3 3"]
) -> tuple[ShotEdge, ...]:
    """Edges between the shots whose key frames (people left out, see `only_background`) show the same background.

    `key_frames[k]` are the features of shot k, empty where the shot failed.
    """
    edges = []
    for b in range(1, len(key_frames)):
        for a in range(max(0, b - REACH), b):
            first, second = key_frames[a], key_frames[b]
            if b - a > 1 and len(key_frames) > COMPARE_ALL and not may_share_a_background(first, second):
                continue
            frames = _compared(first, second, K)
            if frames:
                edges.append(ShotEdge(a, b, frames))
    return tuple(edges)


def sigma_deg(hypothesis: ViewHypothesis, focal_uncertainty: float) -> float:
    """68 % of the rotations of such hypotheses are off by less than this, degrees, when they are true.

    With a focal length wrong by a fraction e (`focal_uncertainty`, its standard deviation), a rotation by α is
    estimated as about (1 + e) α, since both are read off the same image displacement; few inliers leave more open.
    """
    if hypothesis.source == "same camera":
        return 0.2
    angle = np.degrees(rotation_angle(hypothesis.R_a_b))
    return float(np.sqrt(LEAST_DEG**2 + (angle * focal_uncertainty) ** 2 + (INLIER_DEG / hypothesis.num_inliers) ** 2))


def _compared(
    a: Sequence[FrameFeatures], b: Sequence[FrameFeatures], K: Float[np.ndarray, "3 3"]
) -> tuple[FrameEdge, ...]:
    """The most alike pairs of key frames compared; a recurring camera ends the search."""
    # a's last and b's first key frame are closest in time: they come first among equals.
    pairs = [(frame_a, frame_b) for frame_a in reversed(a) for frame_b in b]
    alike = [-_num_alike(frame_a, frame_b) for frame_a, frame_b in pairs]
    found: list[FrameEdge] = []
    for index in np.argsort(alike, kind="stable")[:FULL_COMPARISONS]:
        frame_a, frame_b = pairs[index]
        edge = find_frame_edge(frame_a, frame_b, K)
        if edge is not None and edge.same_camera:
            return (edge,)
        if edge is not None:
            found.append(edge)
    return tuple(found)


def _num_alike(a: FrameFeatures, b: FrameFeatures) -> int:
    """Matches of their strongest features alone."""
    return len(match_features(a.roots[:QUICK_FEATURES], b.roots[:QUICK_FEATURES])[0])


def may_share_a_background(a: Sequence[FrameFeatures], b: Sequence[FrameFeatures]) -> bool:
    """A quick look at the last key frame of one shot and the first of another; not if either has none."""
    return bool(a and b) and _num_alike(a[-1], b[0]) >= MIN_MATCHES
