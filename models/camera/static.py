"""Is the camera static? The first test of a shot, before any geometry.

A camera on a tripod leaves most of the background where it is, whatever else moves: people, traffic, leaves, flicker.
So the test counts the points that stay, instead of averaging over all, and compares with the best camera-like motion
of the picture.
"""

import math

import cv2
import numpy as np
from jaxtyping import Float

from humanmm.models.camera.odometry.tracked_shot import TrackedShot

STILL_FRACTION_OF_DIAGONAL = 0.003
"""Motion below this fraction of the picture's diagonal is no motion: 0.2 degrees for a normal lens, the sway of a
tripod."""
MIN_STILL_POINTS = 0.4
CLEARLY_STILL_POINTS = 0.7
WINDOW_IMAGES = 12
"""Length of the windows over which a slow creep is summed up."""
MIN_SHARED = 8
"""Fewer points tell nothing of a motion."""
FOLLOWS_OF_STILL = 0.25
"""A point follows a slow zoom or roll within this fraction of what is no motion."""
ERROR_OF_WINDOWS = 9
"""A slow zoom or roll is seen where the corners move by more than what is no motion, times the root of the number of
windows and so many more: their errors add up as a random walk. In static clips of up to 700 frames the corners move by
at most 0.74 times what is no motion, in a zoom of 12 % 20 times."""


def is_static(shot: TrackedShot) -> bool:
    """Whether the background stays where it is from the first to the last recorded frame.

    The shot is cut into windows; in each, every image is compared with the window's first one. Creep too slow for a
    window shows in the sum of the windows' motions, which for a static camera is only the tracker's random walk: the
    median shift, and the picture's zoom and roll, which leave its middle where it is.
    """
    tolerance = STILL_FRACTION_OF_DIAGONAL * shot.diagonal_px
    creep, crept, num_windows = np.zeros(2), np.eye(3), 0
    reference, num_checked = 0, 0
    for image in range(1, shot.num_images):
        _, before, now = shot.shared(reference, image)
        if len(before) < MIN_SHARED:
            reference = image
            continue
        num_checked += 1
        moved = np.linalg.norm(now - before, axis=1)
        still = moved < tolerance
        fraction = float(still.mean())
        shift = np.median((now - before)[still], axis=0) if still.any() else np.median(now - before, axis=0)
        motion, explained = _picture_motion(before, now, tolerance)
        moves_as_one = (
            _corner_motion(motion, shot) > tolerance and fraction < CLEARLY_STILL_POINTS and explained > fraction + 0.15
        )
        if fraction < MIN_STILL_POINTS or moves_as_one or float(np.linalg.norm(creep + shift)) > tolerance:
            return False
        few_left = len(before) < 0.5 * (shot.begins[reference + 1] - shot.begins[reference])
        if image - reference >= WINDOW_IMAGES or few_left or image == shot.num_images - 1:
            creep = creep + shift
            if still.sum() >= MIN_SHARED:
                crept = _picture_motion(before[still], now[still], FOLLOWS_OF_STILL * tolerance)[0] @ crept
            num_windows += 1
            if _corner_motion(crept, shot) > tolerance * math.sqrt(ERROR_OF_WINDOWS + num_windows):
                return False
            reference = image
    return num_checked > 0 or shot.num_images == 1


def _picture_motion(
    before: Float[np.ndarray, "n 2"], now: Float[np.ndarray, "n 2"], tolerance: float
) -> tuple[Float[np.ndarray, "3 3"], float]:
    """The most common similarity motion of centred pixels, and the fraction of points that follow it."""
    cv2.setRNGSeed(0)
    motion, followers = cv2.estimateAffinePartial2D(before, now, method=cv2.RANSAC, ransacReprojThreshold=tolerance)
    if motion is None:
        return np.eye(3), 0.0
    return np.vstack([motion, [0.0, 0.0, 1.0]]), float(followers.mean())


def _corner_motion(motion: Float[np.ndarray, "3 3"], shot: TrackedShot) -> float:
    """How far a similarity motion carries a corner of the picture at most, pixels."""
    corners = np.array([(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * (shot.width, shot.height)
    moved = corners @ motion[:2, :2].T + motion[:2, 2] - corners
    return float(np.linalg.norm(moved, axis=1).max())
