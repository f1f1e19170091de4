"""A wall with blobs of many sizes and greys."""

import cv2
import numpy as np

from humanmm.models.camera.background.keyframes import FrameFeatures, features_of
from humanmm.models.camera.background.segments import detect_segments


def textured_wall(seed: int, side: int = 900) -> np.ndarray:
    """Blobs of many sizes and greys: something to recognise at every scale."""
    random = np.random.default_rng(seed)
    picture = np.full((side, side), 128, np.uint8)
    for _ in range(1500):
        centre = tuple(int(v) for v in random.integers(0, side, 2))
        cv2.circle(picture, centre, int(random.integers(3, 30)), int(random.integers(0, 256)), -1)
    return cv2.GaussianBlur(picture, (0, 0), 1.0)


def described(frame: int, gray: np.ndarray) -> FrameFeatures:
    """A picture in which nobody is."""
    return FrameFeatures(frame, *features_of(gray), detect_segments(gray))
