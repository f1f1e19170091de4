"""Is the camera static? The first test of a shot, before any geometry.

A camera on a tripod leaves most of the background where it is, whatever else moves: people, traffic, leaves, flicker.
So the test counts the points that stay, instead of averaging over all, and compares with the best camera-like motion
of the picture.
"""

import cv2
import numpy as np

from humanmm.models.camera.odometry.tracked_shot import TrackedShot

STILL_FRACTION_OF_DIAGONAL = 0.003
"""Motion below this fraction of the picture's diagonal is no motion: 0.2 degrees for a normal lens, the sway of a
tripod."""
MIN_STILL_POINTS = 0.4
CLEARLY_STILL_POINTS = 0.7
WINDOW_IMAGES = 12
"""Length of the windows over which a slow creep is summed up."""


def is_static(shot: TrackedShot) -> bool:
    """Whether the background stays where it is from the first to the last recorded frame.

    The shot is cut into windows; in each, every image is compared with the window's first one. Creep too slow for a
    window shows in the sum of the windows' motions, which for a static camera is only the tracker's random walk.
    """
    tolerance = STILL_FRACTION_OF_DIAGONAL * shot.diagonal_px
    creep = np.zeros(2)
    reference, num_checked = 0, 0
    for image in range(1, shot.num_images):
        _, before, now = shot.shared(reference, image)
        if len(before) < 8:
            reference = image
            continue
        num_checked += 1
        moved = np.linalg.norm(now - before, axis=1)
        still = moved < tolerance
        fraction = float(still.mean())
        shift = np.median((now - before)[still], axis=0) if still.any() else np.median(now - before, axis=0)
        motion, explained = _picture_motion(before, now, tolerance, shot)
        moves_as_one = motion > tolerance and fraction < CLEARLY_STILL_POINTS and explained > fraction + 0.15
        if fraction < MIN_STILL_POINTS or moves_as_one or float(np.linalg.norm(creep + shift)) > tolerance:
            return False
        few_left = len(before) < 0.5 * (shot.begins[reference + 1] - shot.begins[reference])
        if image - reference >= WINDOW_IMAGES or few_left:
            creep = creep + shift
            reference = image
    return num_checked > 0 or shot.num_images == 1


def _picture_motion(before: np.ndarray, now: np.ndarray, tolerance: float, shot: TrackedShot) -> tuple[float, float]:
    """Largest corner motion of the most common similarity motion, and the fraction of points that follow it."""
    cv2.setRNGSeed(0)
    motion, followers = cv2.estimateAffinePartial2D(before, now, method=cv2.RANSAC, ransacReprojThreshold=tolerance)
    if motion is None:
        return 0.0, 0.0
    corners = np.array([(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * (shot.width, shot.height)
    moved = corners @ motion[:, :2].T + motion[:, 2] - corners
    return float(np.linalg.norm(moved, axis=1).max()), float(followers.mean())
