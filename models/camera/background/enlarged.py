"""Two frames in which one camera shows the same, once with a longer lens or closer in the cut: an editor's punch-in."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from humanmm.models.camera.background.frame_edges import SAME_CAMERA_FRACTION, match_features
from humanmm.models.camera.background.keyframes import FrameFeatures
from humanmm.models.camera.background.shot_edges import may_share_a_background

LEAST = 0.03
"""Logarithm of the least enlargement."""
MIN_INLIERS, MIN_SHARE = 30, 0.5
"""The fewest matches that lie where the enlargement puts them, and the least share of all matches: it was 0.56 to 0.93
at 15 closer cuts and at most 0.25 at the cuts between cameras of 34 rendered clips of development."""
MOST_TURN_DEG = 1.0


def enlargement(before: Sequence[FrameFeatures], after: Sequence[FrameFeatures], longer_side_px: float) -> float | None:
    """How many times as long the second shot's lens is, where one camera that neither moved nor turned took the last
    key frame of one shot and the first of the next; None where that is not seen, or the lens is the same.

    Such a camera's two pictures differ by a scale and a shift: all of the background, whatever its distance, which no
    camera that has moved would show.
    """
    if not may_share_a_background(before, after):
        return None
    a, b = before[-1], after[0]
    index_a, index_b = match_features(a.roots, b.roots)
    if len(index_a) < MIN_INLIERS:
        return None
    cv2.setRNGSeed(0)
    motion, mask = cv2.estimateAffinePartial2D(
        a.xy[index_a], b.xy[index_b], method=cv2.RANSAC,
        ransacReprojThreshold=1.5 * SAME_CAMERA_FRACTION * longer_side_px, maxIters=2000,
    )  # fmt: skip
    if motion is None:
        return None
    inliers = int(mask.sum())
    scale, turn = math.hypot(motion[0, 0], motion[1, 0]), math.atan2(motion[1, 0], motion[0, 0])
    agreed = inliers >= MIN_INLIERS and inliers >= MIN_SHARE * len(index_a)
    return scale if agreed and abs(math.log(scale)) > LEAST and abs(np.degrees(turn)) < MOST_TURN_DEG else None
