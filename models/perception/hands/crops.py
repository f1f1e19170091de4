"""Where a hand is looked for: from the body's wrist and knuckles, or from the landmarks of the frame before.

Both as in MediaPipe (HandDetectionsFromPoseToRectsCalculator; hand_landmark_landmarks_to_roi).
"""

import numpy as np
from jaxtyping import Float

from humanmm.models.perception.regions import Region

BODY_SCALE = 2.7
"""Side of the region over twice the distance from wrist to knuckles."""
_POINTS_SCALE, _POINTS_SHIFT = 2.0, 0.1
_PALM = (0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18)
"""Wrist, thumb but its tip, bases and middle joints of the fingers: what stays when the fingers bend."""
_WRIST, _INDEX, _MIDDLE, _RING = 0, 6, 10, 14

_BODY_HANDS = ((15, 17, 19), (16, 18, 20))
"""Left and right: landmarks of the body at wrist, little finger and index finger."""


def of_body(keypoints: Float[np.ndarray, "33 3"], side: int) -> Region | None:
    """The region of the left (0) or right (1) hand that the body's landmarks give; None where they fall together."""
    wrist, pinky, index = (keypoints[landmark, :2] for landmark in _BODY_HANDS[side])
    middle = (2 * index + pinky) / 3
    dx, dy = middle - wrist
    reach = float(np.hypot(dx, dy))
    if reach < 1:
        return None
    return Region(float(middle[0]), float(middle[1]), 2 * reach * BODY_SCALE, float(np.arctan2(dx, -dy)))


def of_points(points: Float[np.ndarray, "21 2"]) -> Region:
    """The region for the next frame: upright along the hand, about its palm and the bases of its fingers."""
    ahead = ((points[_INDEX] + points[_RING]) / 2 + points[_MIDDLE]) / 2 - points[_WRIST]
    angle = float(np.arctan2(ahead[0], -ahead[1]))
    right, up = np.array([np.cos(angle), np.sin(angle)]), np.array([np.sin(angle), -np.cos(angle)])
    along = points[list(_PALM)] @ np.column_stack([right, up])
    low, high = along.min(axis=0), along.max(axis=0)
    middle, size = (low + high) / 2, high - low
    centre = middle[0] * right + (middle[1] + _POINTS_SHIFT * size[1]) * up
    return Region(float(centre[0]), float(centre[1]), max(_POINTS_SCALE * float(size.max()), 2.0), angle)
