"""Which shots show the same background, and the relative poses of their cameras (see `frame_edges`).

Neighbouring shots are always compared. Any two shots are compared in short videos; in long ones only where a quick look
at their strongest features finds enough of them in common, so that the cost grows with the number of shots and not with
its square times the cost of a full comparison.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.camera.background.frame_edges import MIN_MATCHES, FrameEdge, find_frame_edge, match_features
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.geometry.rotations import rotation_angle

COMPARE_ALL = 8
"""Up to so many shots, any two are compared in full."""
REACH = 40
"""In longer videos a shot is compared with so many before it."""
QUICK_FEATURES = 400
FULL_COMPARISONS = 3
"""Pairs of key frames of two shots that are compared in full: those that look most alike at a quick look."""


@dataclass(frozen=True)
class ShotEdge:
    """Relative pose of the cameras at two frames of different shots, from the background alone."""

    shot_a: int
    shot_b: int
    frames: FrameEdge
    sigma_deg: float
    """Expected rotation error: few inliers, and a focal length that is not known, make it larger."""


def find_shot_edges(
    key_frames: Sequence[Sequence[FrameFeatures]], *, K: Float[np.ndarray, "3 3"], focal_uncertainty: float
) -> tuple[ShotEdge, ...]:
    """Edges between the shots whose key frames (people left out, see `without_people`) show the same background.

    `key_frames[k]` are the features of shot k, empty where the shot failed; `focal_uncertainty` is the standard
    deviation of the focal length as a fraction of it.
    """
    edges = []
    for b in range(1, len(key_frames)):
        for a in range(max(0, b - REACH), b):
            first, second = key_frames[a], key_frames[b]
            if b - a > 1 and len(key_frames) > COMPARE_ALL and not _may_share_a_background(first, second):
                continue
            frames = _strongest(first, second, K)
            if frames is not None:
                edges.append(ShotEdge(a, b, frames, sigma_deg(frames, focal_uncertainty)))
    return tuple(edges)


def sigma_deg(edge: FrameEdge, focal_uncertainty: float) -> float:
    """Expected rotation error of an edge, degrees.

    With a focal length wrong by a fraction e, a rotation by α is estimated as about (1 + e) α, since both are read off
    the same image displacement; below that lies what few inliers leave open (400° / inliers: of rendered and real
    pairs with 15 to 30 inliers most are off by more than 15°, with 40 and more by less than 3°).
    """
    if edge.same_camera:
        return 0.1
    angle = np.degrees(rotation_angle(edge.R_a_b))
    return float(np.sqrt(1.0 + (angle * focal_uncertainty) ** 2 + (400.0 / edge.num_inliers) ** 2))


def _strongest(a: Sequence[FrameFeatures], b: Sequence[FrameFeatures], K: Float[np.ndarray, "3 3"]) -> FrameEdge | None:
    """The edge with most inliers over the most alike pairs of key frames; a recurring camera ends the search."""
    # a's last and b's first key frame are closest in time: they come first among equals.
    pairs = [(frame_a, frame_b) for frame_a in reversed(a) for frame_b in b]
    alike = [-len(match_features(_quick(frame_a), _quick(frame_b))[0]) for frame_a, frame_b in pairs]
    best = None
    for index in np.argsort(alike, kind="stable")[:FULL_COMPARISONS]:
        frame_a, frame_b = pairs[index]
        edge = find_frame_edge(frame_a, frame_b, K)
        if edge is not None and (best is None or edge.num_inliers > best.num_inliers):
            best = edge
        if best is not None and best.same_camera:
            return best
    return best


def _quick(frame: FrameFeatures) -> FrameFeatures:
    """Its strongest features only."""
    return replace(frame, xy=frame.xy[:QUICK_FEATURES], descriptors=frame.descriptors[:QUICK_FEATURES])


def _may_share_a_background(a: Sequence[FrameFeatures], b: Sequence[FrameFeatures]) -> bool:
    return bool(a and b) and len(match_features(_quick(a[-1]), _quick(b[0]))[0]) >= MIN_MATCHES
