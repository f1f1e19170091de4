"""Straight edges of a picture, and the planes through the camera in which they lie.

LSD (Grompone von Gioi, Jakubowicz, Morel and Randall, "LSD: a fast line segment detector with a false detection
control", PAMI 2010), as OpenCV has it. Pixels have their centres at (0.5, 0.5).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.geometry.projection import viewing_rays
from humanmm.models.geometry.rotations import unit

Array = np.ndarray

MAX_SEGMENTS = 120
"""The longest of a picture. On development clips frames found from 100, 150 and 300 are right equally often."""
LEAST_LENGTH = 0.02
"""Shortest segment, of the picture's longer side."""
SEEN_SIDE_PX = 1280
"""Longer side of the pictures in which segments are found; larger ones are reduced to it. Detail beyond does
not repeat between cameras."""
ENDPOINT_PX = 0.6
"""Error of a segment's ends across it, pixels of the picture in which it was found."""
MODEL_DEG = 0.7
"""Error of directions that length does not explain: walls not quite at right angles, lenses, rolling shutters."""
NEAREST_SINE = 0.01
"""Of the angle between a segment's viewing ray and a direction; below it the picture shows no angle between them."""


def detect_segments(gray: UInt8[np.ndarray, "height width"]) -> Float[np.ndarray, "segments 4"]:
    """The longest straight edges of a picture, x0 y0 x1 y1 in its pixels, float32, longest first."""
    found = cv2.createLineSegmentDetector().detect(gray)[0]
    if found is None:
        return np.zeros((0, 4), np.float32)
    ends = found.reshape(-1, 4) + np.float32(0.5)
    length = np.linalg.norm(ends[:, 2:] - ends[:, :2], axis=1)
    order = np.argsort(-length, kind="stable")[:MAX_SEGMENTS]
    return np.asarray(ends[order[length[order] >= LEAST_LENGTH * max(gray.shape)]], np.float32)


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments that cameras of one shot see, in one set of axes (a shot's, or a camera's)."""

    normal: Float[Array, "n 3"]
    """Of the plane through the segment and the camera's centre."""
    middle: Float[Array, "n 3"]
    """Unit viewing ray of the segment's middle."""
    sigma: Float[Array, " n"]
    """Error of its direction in the picture, radians."""
    weight: Float[Array, " n"]
    """How much of a witness it is: several key frames of a shot show one edge several times."""

    @classmethod
    def of(
        cls,
        ends: Sequence[Float[Array, "n 4"]],
        K: Sequence[Float[Array, "3 3"]],
        R_axes_cam: Sequence[Float[Array, "3 3"]],
    ) -> "Segments":
        """The segments of one picture or several, source pixels, with the camera of each."""
        parts = []
        for xyxy, K_frame, R in zip(ends, K, R_axes_cam, strict=True):
            xyxy = np.asarray(xyxy, np.float64)
            rays = unit(viewing_rays(xyxy.reshape(-1, 2), K_frame)).reshape(-1, 2, 3)
            length = np.linalg.norm(xyxy[:, 2:] - xyxy[:, :2], axis=1)
            reduced = max(1.0, 2 * float(K_frame[:2, 2].max()) / SEEN_SIDE_PX)  # the principal point is in the middle
            across = math.sqrt(2) * ENDPOINT_PX * reduced / np.maximum(length, 1.0)
            sigma = np.hypot(math.radians(MODEL_DEG), across)
            normal = unit(np.cross(rays[:, 0], rays[:, 1])) @ R.T
            parts.append((normal, unit(rays.sum(axis=1)) @ R.T, sigma, np.full(len(xyxy), 1 / len(ends))))
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def residuals(self, axes: Float[Array, "*s 3 a"]) -> tuple[Float[Array, "*s n a"], Float[Array, "*s n a"]]:
        """Angle in the picture between every segment and every axis (a column), radians, and the sine of the angle
        between the axis and the segment's viewing ray."""
        beside = np.sqrt(np.maximum(1 - (self.middle @ axes) ** 2, NEAREST_SINE**2))
        return np.arcsin(np.clip(self.normal @ axes / beside, -1, 1)), beside
